// Opens recordings and forms images, so that the page stays responsive. The page ends a worker to cancel its work.
let Files = null, recording = null, image = null, reported = 0;

// A module of one relaxed instruction: whether the browser has them. Fused multiply-adds are among them.
const RELAXED = [0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 15, 1, 13, 0, 65, 1, 253, 15, 65, 2, 253, 15, 253, 128, 2, 11];

async function load(relaxed) {
  const name = relaxed && WebAssembly.validate(new Uint8Array(RELAXED)) ? "relaxed" : "simd128";
  const library = await import(`./${name}.js`);
  await library.default();
  Files = library.Files;
  // The machine has relaxed instructions that are not fused.
  if (Files.instructions() === "portable") return load(false);
  return { instructions: Files.instructions() };
}

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
  switch (message.task) {
    case "load": return load(message.relaxed);
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
