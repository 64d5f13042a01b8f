// Motion files from a drop or a file choice. In: what the browser gives. Out: files with their labels.

const NAME_CHARS_MAX = 64;

/** A label from a file or folder name: without the ending and a number at the end. */
function labelFrom(name) {
  const stem = name.replace(/\.[^.]*$/, '').replace(/[\s_-]*\d+$/, '');
  return stem.replace(/[^\p{L}\p{N} _-]+/gu, ' ').trim().slice(0, NAME_CHARS_MAX).trim() || 'dance';
}

/** The label of `file` below the folders `folders`: the first folder, or the file's name. */
export function labelOf(file, folders) {
  return labelFrom(folders.length ? `${folders[0]}.` : file.name);
}

/** Reads the entries of a folder, which the browser gives in parts. */
async function entriesOf(folder) {
  const reader = folder.createReader();
  const all = [];
  for (;;) {
    const some = await new Promise((done, fail) => reader.readEntries(done, fail));
    if (!some.length) return all;
    all.push(...some);
  }
}

/** Adds the files below `entry` to `found`. A dropped folder (`isTop`) of folders is a motion folder: its folders are the labels. */
async function walk(entry, folders, found, isTop) {
  if (entry.isFile) {
    const file = await new Promise((done, fail) => entry.file(done, fail));
    found.push({ file, folders });
    return;
  }
  const entries = await entriesOf(entry);
  const isMotionFolder = isTop && entries.some((inner) => inner.isDirectory);
  for (const inner of entries) await walk(inner, isMotionFolder ? folders : [...folders, entry.name], found, false);
}

/** The files of a drop, each with the names of its folders; hidden files are left out. */
export async function droppedFiles(transfer) {
  const entries = [...transfer.items].map((item) => item.webkitGetAsEntry?.()).filter(Boolean);
  if (!entries.length) return [...transfer.files].map((file) => ({ file, folders: [] }));
  const found = [];
  for (const entry of entries) await walk(entry, [], found, true);
  return found.filter(({ file }) => !file.name.startsWith('.'));
}
