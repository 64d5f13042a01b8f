// The promises of one page: each is a test whose result is printed as a line.

/**
 * Watches `page` for errors. `isExpected(text)` returns true for a message of the console that is no error.
 * Returns `{ promise(words, body), end(name) }`: an exception in `body`, or an error of the page, breaks the promise; `end` prints the result of all
 * and ends the process, with status 0 if all are kept.
 */
export function makePromises(page, isExpected = () => false) {
  let failed = 0;
  const wrongs = [];
  page.on('pageerror', (error) => wrongs.push(`script error: ${error.message}`));
  page.on('console', (message) => {
    if (message.type() === 'error' && !isExpected(message.text())) wrongs.push(`console: ${message.text()}`);
  });
  return {
    async promise(words, body) {
      try {
        const note = await body();
        if (wrongs.length) throw new Error(wrongs.splice(0).join('; '));
        console.log(`ok      ${words}${note ? ` (${note})` : ''}`);
      } catch (error) {
        failed += 1;
        console.log(`BROKEN  ${words}: ${error.message.split('\n')[0]}`);
      }
    },
    end(name) {
      console.log(failed ? `${name}: ${failed} promises BROKEN` : `${name}: all promises kept`);
      process.exit(failed ? 1 : 0);
    },
  };
}

/** Throws an error with the text `words` unless `kept` is true. */
export function check(kept, words) {
  if (!kept) throw new Error(words);
}
