// Calls the module: one message a question, one message an answer with the same number.
let ready, opened, recording;
const answers = {
  open({ bytes, said }) {
    recording = undefined;
    opened?.free();
    opened = undefined;
    opened = wasm_bindgen.Opened.read(bytes, said);
    return JSON.parse(opened.summary());
  },
  pack({ bound, effort, identity = crypto.getRandomValues(new Uint32Array(1))[0] }) {
    const began = performance.now();
    recording = opened.pack(bound, wasm_bindgen.Effort[effort], identity);
    const seconds = 1e-3 * (performance.now() - began);
    return { bytes: recording.length, columns: JSON.parse(opened.cost(bound, wasm_bindgen.Effort[effort])), seconds };
  },
  values({ column }) { return { original: opened.values(column), restored: opened.restored(recording, column) }; },
  plan({ column }) { return JSON.parse(opened.plan(column))[0]; },
  recording() { return recording; },
  csv() { return opened.to_csv(recording); },
  verify() { return JSON.parse(opened.verify(recording)); },
  bit(setting) {
    const run = wasm_bindgen.one_bit(setting.memory, setting.ratio, setting.flips, setting.loss, setting.sensors, setting.slots, BigInt(setting.seed));
    const found = { truth: run.truth, mean: run.mean, deviation: run.deviation, kalman: run.kalman, threshold: run.threshold, bits: run.bits,
      mse: run.mse, kalmanMse: run.kalman_mse, exact: run.exact, exactKalman: run.exact_kalman };
    run.free();
    return found;
  },
  design(setting) { return JSON.parse(wasm_bindgen.design(JSON.stringify(setting))); },
};
async function compiled(packed) {
  const module = new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip")));
  return wasm_bindgen({ module_or_path: await module.arrayBuffer() });
}
onmessage = async ({ data: { id, question, given, module } }) => {
  if (module) {
    ready = compiled(module);
    return;
  }
  try {
    await ready; // a message may come before the module is compiled
    postMessage({ id, answer: answers[question](given) });
  } catch (problem) {
    postMessage({ id, problem: typeof problem === "string" ? problem : `the page failed (${problem}): please report the table with which it did` });
  }
};
