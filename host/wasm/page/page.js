"use strict";
// Page that forms an image of recordings in the browser. A worker computes; see worker.js.
const $ = (id) => document.getElementById(id);
const page = { worker: null, waiting: new Map(), number: 0, files: [], name: "", grid: null };

function show(state, text) {
  document.body.dataset.state = state;
  $("state").textContent = text;
  const busy = state === "opening" || state === "focusing";
  $("progress").hidden = $("cancel").hidden = !busy;
  $("request").disabled = busy || page.files.length === 0;
  $("files").disabled = busy;
}

// Start a worker and load the library. A worker of a blob inherits the page's content security policy; one of a file would not.
function start() {
  const place = JSON.stringify(new URL("worker.js", location.href).href);
  const script = URL.createObjectURL(new Blob([`import ${place};`], { type: "text/javascript" }));
  page.worker = new Worker(script, { type: "module" });
  page.worker.onmessage = ({ data }) => {
    if ("progress" in data) {
      $("progress").value = data.progress;
      return;
    }
    const waiting = page.waiting.get(data.of);
    if (!waiting) return;
    const { resolve, reject } = waiting;
    page.waiting.delete(data.of);
    if (!("error" in data)) return resolve(data);
    if (data.broken) {
      page.files = [];
      page.worker.terminate();
      start().catch(() => {});
    }
    reject(new Error(data.error));
  };
  page.worker.onerror = () => {
    const remedy = location.protocol === "file:" ? "serve the folder over HTTP" : "use a browser with WebAssembly SIMD";
    for (const { reject } of page.waiting.values()) reject(new Error(`the worker does not start: ${remedy}`));
    page.waiting.clear();
  };
  // The fragment #simd128 selects the module without relaxed instructions.
  return ask("load", { relaxed: location.hash !== "#simd128" });
}

function ask(task, about = {}) {
  const number = page.number++;
  return new Promise((resolve, reject) => {
    page.waiting.set(number, { resolve, reject });
    page.worker.postMessage({ number, task, ...about });
  });
}

const CANCELLED = "cancelled";

// End the worker with all its work, and open the same files in a new one.
async function cancel() {
  const files = page.files;
  page.worker.terminate();
  for (const { reject } of page.waiting.values()) reject(new Error(CANCELLED));
  page.waiting.clear();
  show("opening", CANCELLED);
  await start();
  if (files.length > 0) await open(files);
  else show("empty", "choose a recording");
}

// Show an error. The state after a cancellation is that of `cancel`.
function fail(error) {
  if (error.message !== CANCELLED) show("wrong", error.message);
}

function warn(warnings) {
  $("warnings").replaceChildren(...warnings.map((text) => Object.assign(document.createElement("li"), { textContent: text })));
}

const digits = (x, unit) => `${Number(x.toPrecision(6))} ${unit}`;

async function open(files) {
  if (files.length === 0) return;
  page.files = [];
  $("progress").removeAttribute("value");
  show("opening", "opening");
  try {
    const { summary } = await ask("open", { files });
    page.files = files;
    page.name = summary.name;
    $("facts").hidden = false;
    $("name").textContent = summary.name;
    $("size").textContent = `${summary.pulses} × ${summary.samples}`;
    $("carrier").textContent = digits(summary.carrier_hz / 1e9, "GHz");
    $("bandwidth").textContent = digits(summary.bandwidth_hz / 1e6, "MHz");
    warn(summary.warnings);
    if (summary.grid) setGrid(summary.grid);
    $("figure").hidden = true;
    show("open", "ready");
  } catch (error) {
    $("facts").hidden = true;
    fail(error);
  }
}

const FIELDS = [["centre_m", "centre"], ["size_m", "size"], ["pixels", "pixels"]];

function setGrid(grid) {
  for (const [key, name] of FIELDS) ["x", "y"].forEach((axis, i) => { $(`${name}-${axis}`).value = Number(grid[key][i].toPrecision(12)); });
}

function request() {
  const grid = Object.fromEntries(FIELDS.map(([key, name]) => [key, ["x", "y"].map((axis) => $(`${name}-${axis}`).valueAsNumber)]));
  return { grid, former: $("former").value, error_db: $("error").valueAsNumber, portable: $("portable").checked };
}

async function focus() {
  const asked = request();
  $("progress").value = 0;
  show("focusing", "forming the image");
  try {
    const { facts, levels, grid, milliseconds } = await ask("focus", { request: asked, rangeDb: $("range").valueAsNumber });
    page.grid = grid;
    $("figure").hidden = false;
    $("title").textContent = `${page.name}, ${facts.former}${asked.portable ? ", portable" : ""}`;
    $("time").textContent = `${Math.round(milliseconds)} ms`;
    $("predicted").textContent = `${facts.predicted_error_db.toFixed(1)} dB`;
    $("predicted").className = facts.bound_missed ? "wrong" : "";
    $("upper").textContent = `${facts.upper_db.toFixed(1)} dB`;
    warn(facts.bound_missed ? [`the predicted error exceeds ${asked.error_db} dB`, ...facts.warnings] : facts.warnings);
    draw(levels);
    show("image", "image formed");
  } catch (error) {
    fail(error);
  }
}

function draw(levels) {
  const canvas = $("image"), [width, height] = page.grid.pixels;
  [canvas.width, canvas.height] = [width, height];
  // Pixels may be wider than high.
  canvas.style.aspectRatio = `${page.grid.size_m[0]} / ${page.grid.size_m[1]}`;
  canvas.style.width = `min(100%, ${Math.max(width, 640)}px)`;
  const picture = new ImageData(width, height);
  new Uint32Array(picture.data.buffer).forEach((_, i, pixels) => { pixels[i] = 0xff000000 | (levels[i] * 0x010101); });
  canvas.getContext("2d").putImageData(picture, 0, 0);
}

// The pixels as a NumPy file.
const npy = async () => (await ask("npy")).npy;

function save(blob, suffix) {
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: `${page.name || "image"}${suffix}` });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
}

// The newest dynamic range is drawn; those set meanwhile are left out.
let drawing = false;
async function redraw() {
  $("range-db").textContent = `${$("range").value} dB`;
  if (drawing || document.body.dataset.state !== "image") return;
  drawing = true;
  const rangeDb = $("range").valueAsNumber;
  const { levels } = await ask("levels", { rangeDb });
  draw(levels);
  drawing = false;
  if ($("range").valueAsNumber !== rangeDb) redraw();
}

$("files").addEventListener("change", () => open([...$("files").files]));
$("settings").addEventListener("submit", (event) => { event.preventDefault(); focus(); });
$("range").addEventListener("input", redraw);
$("save-npy").addEventListener("click", async () => save(new Blob([await npy()]), ".npy"));
$("save-png").addEventListener("click", () => $("image").toBlob((blob) => save(blob, ".png")));
$("cancel").addEventListener("click", () => cancel().catch(fail));
$("image").addEventListener("pointermove", (event) => {
  const box = $("image").getBoundingClientRect(), { centre_m, size_m } = page.grid;
  const x = centre_m[0] + ((event.clientX - box.left) / box.width - 0.5) * size_m[0];
  const y = centre_m[1] - ((event.clientY - box.top) / box.height - 0.5) * size_m[1];
  $("cursor").textContent = `x ${x.toFixed(2)} m, y ${y.toFixed(2)} m`;
});
$("image").addEventListener("pointerleave", () => { $("cursor").textContent = ""; });
for (const name of ["dragover", "dragleave", "drop"]) {
  document.addEventListener(name, (event) => {
    event.preventDefault();
    document.body.toggleAttribute("data-drop", name === "dragover");
    const busy = $("files").disabled;
    if (name === "drop" && !busy) open([...event.dataTransfer.files]);
  });
}

start().then(
  ({ instructions }) => {
    $("instructions").textContent = instructions;
    show("empty", "choose a recording");
  },
  fail,
);
