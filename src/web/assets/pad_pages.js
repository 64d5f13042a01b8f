// Pages of pads, a filter and a choice of the group: for shows with more pads than fit. In: pads, what the user types. Out: pads that are hidden or not.

/** Largest number of pads on one page. */
export const PAGE_PADS = 24;

/**
 * Makes the pages of `pads`, the elements of the pads, in `nav`. Returns `{ show(), reveal(label) }`: `show` marks the pages with danced and armed
 * pads, `reveal` shows the page with the pad `label`.
 */
export function makePadPages(nav, pads) {
  const [filter, group, pages] = ['filter', 'group', 'pages'].map((id) => nav.querySelector(`#${id}`));
  const groups = [...new Set(pads.map((pad) => pad.dataset.group))];
  const isMany = pads.length > PAGE_PADS;
  let page = 0;
  let found = pads;
  let marks = '';

  // The buttons of the pads before.
  pages.replaceChildren();
  nav.hidden = groups.length < 2 && !isMany;
  filter.hidden = !isMany;
  group.hidden = groups.length < 2;
  filter.value = '';
  group.replaceChildren(new Option('all groups', ''), ...groups.map((name) => new Option(name)));

  function makeButton(number) {
    const button = Object.assign(document.createElement('button'), { type: 'button', textContent: number + 1 });
    button.addEventListener('click', () => {
      page = number;
      fit();
    });
    return button;
  }

  /** Shows the pads of the page that the filter and the group leave. */
  function fit() {
    const wanted = filter.value.trim().toLowerCase();
    found = pads.filter((pad) => (!group.value || pad.dataset.group === group.value) && pad.dataset.label.toLowerCase().includes(wanted));
    const count = Math.ceil(found.length / PAGE_PADS);
    page = Math.min(page, Math.max(count - 1, 0));
    const shown = new Set(found.slice(page * PAGE_PADS, (page + 1) * PAGE_PADS));
    pads.forEach((pad) => { pad.hidden = !shown.has(pad); });
    if (pages.children.length !== count) pages.replaceChildren(...Array.from({ length: count }, (_, number) => makeButton(number)));
    pages.hidden = count < 2;
    [...pages.children].forEach((button, number) => button.setAttribute('aria-current', number === page ? 'page' : 'false'));
    marks = '';
    show();
  }

  function show() {
    const states = [...pages.children].map((_, number) => {
      const some = found.slice(number * PAGE_PADS, (number + 1) * PAGE_PADS).map((pad) => pad.dataset.state);
      return ['dancing', 'queued'].find((state) => some.includes(state)) ?? 'idle';
    });
    if (marks === states.join()) return;
    marks = states.join();
    const words = { dancing: ', with the danced pad', queued: ', with an armed pad', idle: '' };
    [...pages.children].forEach((button, number) => {
      button.dataset.state = states[number];
      button.setAttribute('aria-label', `Page ${number + 1} of the pads${words[states[number]]}`);
    });
  }

  filter.oninput = () => {
    page = 0;
    fit();
  };
  filter.onkeydown = (event) => {
    if (event.key !== 'Enter' || found.length === 0) return;
    found[page * PAGE_PADS].focus();
  };
  group.onchange = () => {
    page = 0;
    fit();
    group.blur();
  };
  fit();
  return {
    show,
    reveal(label) {
      const place = found.findIndex((pad) => pad.dataset.label === label);
      page = Math.floor(Math.max(place, 0) / PAGE_PADS);
      fit();
    },
  };
}
