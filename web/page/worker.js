// Calls the module: one message a question, one message an answer with the same number.
let ready, opened, recording;
const answers = {
  open({ bytes, name }) {
    opened?.free();
    opened = wasm_bindgen.Opened.read(bytes, name);
    recording = undefined;
    return JSON.parse(opened.summary());
  },
  pack({ bound }) {
    recording = opened.pack(bound);
    return { bytes: recording.length, columns: JSON.parse(opened.cost(recording)) };
  },
  values({ column }) {
    return { original: opened.values(column), restored: recording ? opened.restored(recording, column) : undefined };
  },
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
onmessage = async ({ data: { id, question, given, module } }) => {
  if (module) {
    ready = wasm_bindgen({ module_or_path: module });
    return;
  }
  try {
    await ready; // a message may come before the module is compiled
    postMessage({ id, answer: answers[question](given) });
  } catch (problem) {
    postMessage({ id, problem: typeof problem === "string" ? problem : `the page failed: ${problem}` });
  }
};
