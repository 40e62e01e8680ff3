"use strict";
// Histogram of levels, with lines at the black and the white level that can be dragged.
const histogram = { dragged: null, range: [-60, 0] };

// Range of levels shown: all counted ones and both lines; kept while a line is dragged.
function histogramRange({ first_db: first, counts }) {
  if (histogram.dragged) return;
  // The lowest thousandth of the cells is left out.
  const total = counts.reduce((a, b) => a + b, 0);
  let below = 0, from = 0;
  while (from < counts.length - 1 && below + counts[from] < 1e-3 * total) below += counts[from++];
  histogram.range = [Math.min(first + from, view.top - view.span) - 2, Math.max(first + counts.length, view.top) + 2];
}
const levelAt = (x, wide) => histogram.range[0] + x / wide * (histogram.range[1] - histogram.range[0]);
const atLevel = (db, wide) => (db - histogram.range[0]) / (histogram.range[1] - histogram.range[0]) * wide;

function drawHistogram() {
  const canvas = $("histogram"), seen = image()?.histogram;
  canvas.hidden = !seen;
  if (!seen || view.top === null) return;
  histogramRange(seen);
  const ratio = devicePixelRatio || 1, { width: wide, height: tall } = canvas.getBoundingClientRect(), ink = canvas.getContext("2d");
  canvas.width = Math.round(wide * ratio); canvas.height = Math.round(tall * ratio);
  ink.setTransform(ratio, 0, 0, ratio, 0, 0);
  const base = tall - 14, most = seen.counts.reduce((a, b) => Math.max(a, b));
  ink.fillStyle = css("--faint");
  // Square roots of counts: a few bright cells stay visible.
  seen.counts.forEach((count, i) => {
    const [left, right] = [0, 1].map((k) => atLevel(seen.first_db + i + k, wide)), high = Math.sqrt(count / most) * (base - 4);
    ink.fillRect(left, base - high, Math.max(1, right - left - 0.5), high);
  });
  ink.font = "11px system-ui, sans-serif"; ink.textBaseline = "bottom"; ink.textAlign = "center";
  const { all } = ticks(...histogram.range, wide / 60);
  for (const db of all) if (atLevel(db, wide) > 14 && atLevel(db, wide) < wide - 22) ink.fillText(db.toFixed(0), atLevel(db, wide), tall);
  ink.textAlign = "right"; ink.fillText("dB", wide, tall);
  ink.lineWidth = 2;
  for (const db of [view.top - view.span, view.top]) {
    const x = Math.min(wide - 1, Math.max(1, atLevel(db, wide)));
    ink.strokeStyle = css("--other"); ink.beginPath(); ink.moveTo(x, 0); ink.lineTo(x, base); ink.stroke();
    ink.fillStyle = css("--other"); ink.fillRect(x - 4, 0, 8, 8);
  }
  canvas.setAttribute("aria-label", `histogram of levels from ${seen.first_db} to ${seen.first_db + seen.counts.length} dB; black at ${view.top - view.span} dB, white at ${view.top} dB`);
}

on("histogram", "pointerdown", (event) => {
  const wide = event.target.getBoundingClientRect().width, [black, white] = [view.top - view.span, view.top].map((db) => Math.abs(atLevel(db, wide) - event.offsetX));
  histogram.dragged = black < white ? "black" : "white";
  event.target.setPointerCapture(event.pointerId);
  dragLevel(event);
});
function dragLevel(event) {
  if (!histogram.dragged) return;
  const db = Math.round(levelAt(event.offsetX, event.target.getBoundingClientRect().width)), black = view.top - view.span;
  if (histogram.dragged === "black") choose(view.top, view.top - db);
  else { const top = Math.max(db, black + 5); choose(top, top - black); }
}
on("histogram", "pointermove", dragLevel);
for (const end of ["pointerup", "pointercancel"]) on("histogram", end, () => { histogram.dragged = null; drawHistogram(); });
addEventListener("resize", drawHistogram);
