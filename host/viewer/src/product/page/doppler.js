"use strict";
// Range-Doppler maps around a position in the image.
const doppler = { of: 0, sub: 0, at: null, drawn: null, latest: 0, count: 0, mark: L.layerGroup().addTo(map) };

function beginDoppler() {
  if (!view.doppler.length) return;
  $("doppler-section").hidden = false;
  view.doppler.forEach((maps, i) => { const one = document.createElement("option"); one.textContent = maps.name; one.value = String(i); $("doppler-of").append(one); });
  $("doppler-of").hidden = view.doppler.length < 2;
  askDoppler();
}
// Restore from the address: source of maps, sub-CPI, row, column.
function dopplerAt(text) {
  const words = (text ?? "").split(",").map(Number);
  if (words.length !== 4 || !words.every((n) => Number.isInteger(n) && n >= 0) || !view.doppler[words[0]]) return;
  [doppler.of, doppler.sub] = words;
  $("doppler-of").value = String(doppler.of);
  lookAt(words.slice(2));
}
function forgetDoppler() {
  doppler.at = doppler.drawn = null; doppler.latest++;
  doppler.mark.clearLayers();
  $("doppler-map").hidden = true;
  reportDoppler("");
}

async function askDoppler() {
  const count = view.doppler[doppler.of].sub_cpis;
  doppler.sub = Math.min(Math.max(0, doppler.sub), count - 1);
  $("doppler-sub").max = count - 1; $("doppler-sub").value = doppler.sub; $("doppler-sub").disabled = count < 2;
  $("doppler-text").textContent = `${doppler.sub + 1} of ${count}`;
  if (!doppler.at) return;
  const number = ++doppler.latest, [row, column] = doppler.at;
  const answer = await fetch(`doppler/${doppler.of}/${doppler.sub}/${view.shown}/${row}/${column}`).catch(() => null);
  // Superseded by a later request.
  if (number !== doppler.latest) return;
  if (!answer?.ok) { reportDoppler(answer ? await answer.text() : "no connection to the server", true); return; }
  const drawn = await answer.json();
  if (number !== doppler.latest) return;
  doppler.drawn = drawn;
  drawDoppler(); keepAddress();
}
function reportDoppler(text, isWrong) { $("doppler-message").textContent = text; $("doppler-message").classList.toggle("wrong", Boolean(isWrong)); }

function drawDoppler() {
  const drawn = doppler.drawn;
  if (!drawn) return;
  const seen = drawn.levels.filter((level) => level !== NONE), peak = seen.reduce((a, b) => Math.max(a, b), NONE);
  doppler.mark.clearLayers();
  if (drawn.at) L.circleMarker([drawn.at[0] + 0.5, drawn.at[1] + 0.5], { radius: 7, color: "#cc79a7", fill: false }).addTo(doppler.mark);
  const canvas = $("doppler-map");
  canvas.hidden = false;
  const ratio = devicePixelRatio || 1, box = canvas.getBoundingClientRect(), ink = canvas.getContext("2d");
  canvas.width = Math.round(box.width * ratio); canvas.height = Math.round(box.height * ratio);
  ink.setTransform(ratio, 0, 0, ratio, 0, 0); ink.imageSmoothingEnabled = false;
  const edge = { left: 40, right: 8, top: 6, bottom: 32 }, wide = box.width - edge.left - edge.right, tall = box.height - edge.top - edge.bottom;
  // The dynamic range is 40 dB below the peak of the map, since levels of a sub-CPI differ from those of the image.
  const cells = new OffscreenCanvas(drawn.columns, drawn.rows), pixels = new ImageData(drawn.columns, drawn.rows), table = view.maps[view.map];
  drawn.levels.forEach((level, i) => {
    const row = drawn.rows - 1 - Math.floor(i / drawn.columns), part = level === NONE ? 0 : Math.max(0, 255 - (peak - level) / 400 * 255);
    pixels.data.set([...table[Math.round(part)], 255], 4 * (row * drawn.columns + i % drawn.columns));
  });
  cells.getContext("2d").putImageData(pixels, 0, 0);
  ink.drawImage(cells, edge.left, edge.top, wide, tall);
  ink.font = "11px system-ui, sans-serif"; ink.fillStyle = css("--faint");
  const ends = [0, 1].map((i) => [drawn.first[i] - drawn.steps[i] / 2, drawn.first[i] + (i ? drawn.columns - 0.5 : drawn.rows - 0.5) * drawn.steps[i]]);
  ink.textAlign = "right"; ink.textBaseline = "middle";
  const up = ticks(...ends[0], tall / 34);
  for (const v of up.all) ink.fillText(v.toFixed(up.digits), edge.left - 4, edge.top + tall - (v - ends[0][0]) / (ends[0][1] - ends[0][0]) * tall);
  ink.textAlign = "center"; ink.textBaseline = "top";
  const across = ticks(...ends[1], wide / 50);
  for (const v of across.all) ink.fillText(v.toFixed(across.digits), Math.min(edge.left + (v - ends[1][0]) / (ends[1][1] - ends[1][0]) * wide, edge.left + wide - 8), edge.top + tall + 4);
  ink.textAlign = "left";
  ink.fillText(`horizontal: range (m); vertical: Doppler (${drawn.timed ? "Hz" : "cycles/pulse"})`, 2, edge.top + tall + 18);
  const [x, y, z] = drawn.place_m.map((v) => v.toFixed(1)), times = drawn.timed ? `, ${drawn.time_s[0].toFixed(3)} to ${drawn.time_s[1].toFixed(3)} s` : "";
  reportDoppler(`centre x ${x} m, y ${y} m, z ${z} m: ${drawn.pulses} pulses${times}; ${seen.length ? `peak ${(peak / 10).toFixed(1)} dB` : "no data"}`);
  canvas.setAttribute("aria-label", `range-Doppler map, ${drawn.rows} Doppler bins by ${drawn.columns} range bins, ${$("doppler-message").textContent}`);
  document.body.dataset.doppler = String(++doppler.count);
}

function lookAt([row, column]) {
  const about = image();
  doppler.at = [Math.min(Math.max(0, row), about.rows - 1), Math.min(Math.max(0, column), about.columns - 1)];
  askDoppler();
}
function step(by) { if (!$("doppler-section").hidden) { doppler.sub += by; askDoppler(); } }
on("doppler", "click", () => mode("doppler"));
on("doppler-of", "change", () => { doppler.of = +$("doppler-of").value; askDoppler(); });
on("doppler-sub", "input", () => { doppler.sub = +$("doppler-sub").value; askDoppler(); });
addEventListener("resize", drawDoppler);
Object.assign(KEYS, { m: () => view.doppler.length && mode("doppler"), "<": () => step(-1), ">": () => step(1) });
