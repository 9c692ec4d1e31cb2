// One bit.
const SLIDERS = [
  ["memory", "memory of the process", 0, 0.999, 0.001, 0.95],
  ["ratio", "process variance over noise variance", -3, 1, 0.05, -0.7, (v) => 10 ** v],
  ["flips", "share of inverted bits", 0, 0.45, 0.01, 0],
  ["loss", "share of lost bits", 0, 0.9, 0.01, 0],
  ["sensors", "sensors", 1, 16, 1, 1],
  ["slots", "slots", 50, 1000, 50, 200],
  ["seed", "seed", 1, 99, 1, 7],
];
get("bit-controls").innerHTML = SLIDERS.map(([name, label, min, max, step, value]) =>
  `<label>${label} <output></output> <input type="range" name="${name}" min="${min}" max="${max}" step="${step}" value="${value}"></label>`).join("");
let bitRuns = 0;
const showBit = latest(async () => {
  const setting = {};
  for (const [name, , , , , , shape] of SLIDERS) {
    const input = get("bit-controls").querySelector(`[name=${name}]`);
    setting[name] = (shape ?? Number)(+input.value);
    input.previousElementSibling.textContent = +setting[name].toPrecision(3);
    if (shape) input.setAttribute("aria-valuetext", setting[name].toPrecision(3));
  }
  let found;
  try {
    found = await ask("bit", setting);
    get("bit-problem").textContent = "";
  } catch (problem) {
    get("bit-problem").textContent = problem.message;
    return;
  }
  const x = Float64Array.from(found.truth, (_, i) => i);
  const fallen = (X, Y) => Array.from(x, (t) => {
    const bit = found.bits[t * setting.sensors], at = X(t), y = Y(found.threshold[t]);
    return bit === 0 ? "" : `<line class="bit${bit > 0 ? 1 : 0}" x1="${at}" x2="${at}" y1="${y}" y2="${y + (bit > 0 ? -9 : 9)}"/>`;
  }).join("");
  draw(get("bit-plot"), {
    series: [
      { kind: "band", x, low: found.mean.map((m, i) => m - 2 * found.deviation[i]), high: found.mean.map((m, i) => m + 2 * found.deviation[i]), label: "± 2 deviations" },
      { x, y: found.truth, style: "ink", label: "process" },
      { x, y: found.mean, style: "one", label: "from bits" },
      { x, y: found.kalman, style: "two", label: "Kalman" },
    ],
    xLabel: "slot", yLabel: "state", extra: setting.slots <= 400 ? fallen : undefined,
  });
  const exact = (value) => Number.isFinite(value) ? value.toFixed(4) : "not known in closed form", ratio = found.exact / found.exactKalman;
  get("bit-numbers").textContent = `Mean squared error in this run: ${found.mse.toFixed(4)} from bits, ${found.kalmanMse.toFixed(4)} of the Kalman filter. ` +
    `In the long run: ${exact(found.exact)} and ${exact(found.exactKalman)}` + (Number.isFinite(ratio) ? `; one bit in place of each sample costs ${(100 * (ratio - 1)).toFixed(1)} %.` : ".");
  get("bit-rust").textContent = rustOf(setting);
  get("bit-python").textContent = pythonOf(setting);
  document.body.dataset.bit = ++bitRuns;
});
const priorOf = ({ memory, ratio }) => memory < 1 ? ratio / (1 - memory * memory) : 1;
function rustOf(setting) {
  const link = setting.loss || setting.flips ? `.with_link(Link::new(${decimal(setting.loss)}, ${decimal(setting.flips)})?)` : "", several = setting.sensors > 1;
  const step = (pad, sample) => `${pad}let bit = Sign::of(${sample}, filter.feedback(&belief))?; // at the sensor
${pad}belief = filter.update(&belief, &Observation::Received(bit))?.0; // Observation::Nothing if it was lost`;
  return `use fewbits::core::{Gaussian, ${link ? "Link, " : ""}Observation, Sign};
use fewbits::dymbo::{DymboFilter, ScalarFilter, ScalarPlant};

// Noise variance 1. ${several ? `\`slots\`: ${setting.sensors} samples each.` : "`samples`: one per slot."}
let filter = DymboFilter::new(ScalarPlant::new(${decimal(setting.memory)}, ${decimal(setting.ratio)}, 1.0)?)${link};
let mut belief = Gaussian::scalar(0.0, ${decimal(priorOf(setting))})?;
for ${several ? "samples in slots" : "sample in samples"} {
    belief = filter.predict(&belief);
${several ? `    for sample in samples {\n${step("        ", "sample")}\n    }` : step("    ", "sample")}
}`;
}
const decimal = (value) => { const text = `${+value.toPrecision(6)}`; return /^-?\d+$/.test(text) ? `${text}.0` : text; };
function pythonOf(setting) {
  if (setting.sensors > 1 || setting.loss) return "# The Python class takes one sensor whose bits all arrive: set sensors to 1 and lost bits to 0.";
  return `import fewbits as fb

run = fb.OneBit(a=${decimal(setting.memory)}, process=${decimal(setting.ratio)}, noise=1.0, flips=${decimal(setting.flips)}).run(samples, mean=0.0, variance=${decimal(priorOf(setting))})
run.mean, run.variance, run.bits`;
}
get("bit-controls").oninput = showBit;
for (const button of document.querySelectorAll(".copy")) {
  button.onclick = async () => {
    const text = get(button.dataset.copy);
    try {
      await navigator.clipboard.writeText(text.textContent);
      get("copied").textContent = "copied";
    } catch {
      getSelection().selectAllChildren(text);
      get("copied").textContent = document.execCommand("copy") ? "copied" : "selected: copy it with the keyboard";
    }
  };
}

// Design.
let designed, designs = 0;
const numbers = (text) => text.split(/[\s,;]+/).filter(Boolean).map(Number);
get("design-form").onsubmit = async (event) => {
  event.preventDefault();
  const form = new FormData(event.target), number = (name) => Number(form.get(name));
  const setting = { mean: number("mean"), deviation: number("deviation"), noise: numbers(form.get("noise")), bits: numbers(form.get("bits")),
    flips: number("flips"), loss: number("loss"), criterion: form.get("criterion") };
  get("design-problem").textContent = "";
  get("design-state").textContent = "designing, at most some 20 seconds …";
  try {
    if ([...setting.noise, ...setting.bits].some((n) => !Number.isFinite(n))) throw new Error("noises and bits are numbers with commas between them, as `1, 1.5`");
    if (setting.bits.some((n) => !Number.isInteger(n) || n < 0)) throw new Error("bits are whole numbers");
    designed = { ...await ask("design", setting), setting };
    showDesign();
  } catch (problem) {
    get("design-problem").textContent = problem.message;
    get("design-state").textContent = "";
    get("design-found").hidden = true;
    designed = undefined;
  }
  document.body.dataset.designed = ++designs;
};
function showDesign() {
  if (!designed) return;
  const { setting } = designed, error = setting.criterion === "error";
  get("design-state").textContent = `${error ? "mean squared error" : "information / nat"} ${designed.value.toPrecision(6)}` +
    (designed.bound === null ? "" : `; no design can be ${error ? "below" : "above"} ${designed.bound.toPrecision(6)}`);
  get("design-found").hidden = false;
  get("cells").tBodies[0].innerHTML = designed.cells.map((cell) => `<tr><th scope="row">${cell.sensor + 1}</th><td>${cell.lower === null ? "−∞" : short(cell.lower)}</td><td>${cell.upper === null ? "∞" : short(cell.upper)}</td><td>${cell.word}</td></tr>`).join("");
  const spread = setting.noise.map((noise) => Math.hypot(setting.deviation, noise)), reach = 3.2 * Math.max(...spread), count = setting.noise.length;
  const x = Float64Array.from({ length: 400 }, (_, i) => setting.mean - reach + 2 * reach * i / 399);
  const density = x.map((v) => count + 0.9 * Math.exp(-0.5 * ((v - setting.mean) / setting.deviation) ** 2));
  draw(get("design-plot"), {
    series: [{ x, y: density, style: "one", label: "density of the unknown" }], xRange: [x[0], x[399]], yRange: [0, count + 1],
    xLabel: "measurement", yLabel: "sensor", yTicks: setting.noise.map((_, n) => [count - n - 0.5, `${n + 1}`]),
    extra: (X, Y) => designed.cells.map((cell) => {
      const from = X(cell.lower ?? x[0]), to = X(cell.upper ?? x[399]), top = Y(count - cell.sensor - 0.1), bottom = Y(count - cell.sensor - 0.9);
      return `<rect class="chosen" x="${from}" width="${Math.max(0, to - from)}" y="${top}" height="${bottom - top}"/>` +
        (to - from > 14 ? `<text class="word" x="${(from + to) / 2}" y="${(top + bottom) / 2 + 5}" text-anchor="middle">${cell.word}</text>` : "");
    }).join(""),
  });
}
get("download-header").onclick = () => download("quantizers.h", "text/x-c", designed.header);

// Which scheme. The one that was named last is named again when the price changes.
let named;
function showFrontier() {
  const price = get("price").value, label = get("price").selectedOptions[0].textContent;
  const x = FRONTIER.map((one) => Math.log10(one[price])), y = FRONTIER.map((one) => one.rmse);
  const best = (one) => !FRONTIER.some((other) => other !== one && other.rmse <= one.rmse && other[price] <= one[price]);
  const said = (one) => `${one.scheme}: RMSE ${one.rmse.toFixed(3)}, ${label.replace(" / ", " ")} ${short(one[price])}`;
  const [from, to] = extent([x]), nice = [1, 2, 5].flatMap((m) => [-2, -1, 0, 1, 2, 3, 4].map((e) => Math.log10(m) + e)).sort((a, b) => a - b).filter((t) => t >= from && t <= to);
  const spread = get("frontier-plot").clientWidth < 500 && nice.length > 6 ? nice.filter((t) => Math.abs(t - Math.round(t)) < 1e-9) : nice;
  draw(get("frontier-plot"), {
    series: [{ x: Float64Array.from(x), y: Float64Array.from(y), style: "none" }], xRange: [from, to], yRange: extent([y]), xLabel: label, yLabel: "RMSE", xTicks: spread, xText: (t) => short(10 ** t),
    extra: (X, Y) => FRONTIER.map((one, i) => `<circle class="dot${best(one) ? " best" : ""}" tabindex="0" role="img" aria-label="${escaped(said(one))}" data-scheme="${i}" cx="${X(x[i])}" cy="${Y(y[i])}" r="7"><title>${escaped(said(one))}</title></circle>`).join(""),
  });
  const name = (scheme) => { named = scheme; get("frontier-name").textContent = said(FRONTIER[scheme]); };
  if (named !== undefined) name(named);
  // A pointer that rests where a dot is drawn anew also enters it: only one that moves names a scheme.
  for (const dot of get("frontier-plot").querySelectorAll(".dot")) dot.onpointermove = dot.onfocus = dot.onclick = () => name(dot.dataset.scheme);
  get("schemes").tBodies[0].innerHTML = FRONTIER.map((one) => `<tr><th scope="row" title="${escaped(one.scheme)}">${escaped(one.scheme)}</th><td>${one.rmse.toFixed(3)}</td><td>${short(one.payload)}</td><td>${short(one.air)}</td><td>${short(one.energy)}</td></tr>`).join("");
}
get("price").onchange = showFrontier;
onresize = () => choose(tabs.find((tab) => tab.getAttribute("aria-selected") === "true"));
document.body.dataset.loaded = 1;
