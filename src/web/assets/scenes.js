// Scenes: one button for each. In: names, the state of the show. Out: messages to the show.

/** Fills `section` with the controls; `send(message)` sends a message. Returns `{ names(list), state(message) }`. */
export function makeScenes(section, send) {
  let buttons = [];
  const end = Object.assign(document.createElement('button'), { type: 'button', textContent: '×', disabled: true });
  end.setAttribute('aria-label', 'End the scene: no labels of a scene, all dancers dance');
  end.addEventListener('click', () => send({ scene_end: true }));

  return {
    /** Takes the names of the scenes. */
    names(list) {
      buttons = list.map((name) => {
        const button = Object.assign(document.createElement('button'), { type: 'button', textContent: name, title: name });
        button.dataset.scene = name;
        button.dataset.state = 'idle';
        button.setAttribute('aria-pressed', false);
        button.addEventListener('click', () => send({ scene: name }));
        return button;
      });
      section.hidden = list.length === 0;
      section.replaceChildren(...buttons, ...(list.length ? [end] : []));
    },

    /** Shows which scene is on and which one waits. */
    state(message) {
      end.disabled = (message.scene ?? message.next_scene ?? null) === null;
      buttons.forEach((button, i) => {
        const state = message.scene === i ? 'on' : 'idle';
        const shown = message.next_scene === i ? 'queued' : state;
        if (button.dataset.state === shown) return;
        button.dataset.state = shown;
        button.setAttribute('aria-pressed', message.scene === i);
        button.setAttribute('aria-label', shown === 'queued' ? `${button.dataset.scene}, waits for its beat` : button.dataset.scene);
      });
    },
  };
}
