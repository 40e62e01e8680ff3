// Opens recordings and forms images, so that the page stays responsive. The page ends a worker to cancel its work.
import init, { Files } from "./subaperture_wasm.js";

const loaded = init();
let recording = null, image = null, reported = 0;

// Called by the library with the finished fraction.
globalThis.reportProgress = (fraction) => {
  const now = performance.now();
  if (now - reported > 50) { reported = now; postMessage({ progress: fraction }); }
};

async function open(files) {
  const all = new Files();
  for (const file of files) {
    // The library computes the memory exactly once the file is open.
    if (file.size > all.leftBytes()) throw `${file.name}: expected at most ${all.leftBytes()} bytes, found ${file.size}: use the command`;
    all.add(file.name, new Uint8Array(await file.arrayBuffer()));
  }
  image?.free();
  recording?.free();
  image = recording = null;
  recording = all.open();
  return { summary: JSON.parse(recording.summary()) };
}

function focus(request, rangeDb) {
  image?.free();
  image = null;
  const begun = performance.now();
  image = recording.focus(JSON.stringify(request));
  const milliseconds = performance.now() - begun;
  return { facts: JSON.parse(image.facts()), levels: image.levels(rangeDb), grid: request.grid, milliseconds };
}

async function answer(message) {
  await loaded;
  switch (message.task) {
    case "load": return { instructions: Files.instructions() };
    case "open": return open(message.files);
    case "focus": return focus(message.request, message.rangeDb);
    case "levels": return { levels: image.levels(message.rangeDb) };
    case "npy": return { npy: image.npy() };
  }
}

let last = Promise.resolve();
onmessage = ({ data }) => {
  last = last.then(() => answer(data)).then(
    (done) => postMessage({ of: data.number, ...done }),
    // Text of the library, or an error of the browser: after the latter the memory of the library is not used again.
    (error) => postMessage({ of: data.number, error: String(error), broken: error instanceof WebAssembly.RuntimeError }),
  );
};
