// Unpacks LZMA with the head of a `.lzma` file, of known length. A browser has gzip alone, with which the module is a third larger.
function unpack(packed) {
  const MATCH = 0, LONG = 192, REPEAT = 384, FIRST = 396, SECOND = 408, THIRD = 420, SLOT = 432, SPECIAL = 688, ALIGN = 803, NEW = 819, OLD = 1333, LITERAL = 1847;
  const head = new DataView(packed.buffer, packed.byteOffset), out = new Uint8Array(head.getUint32(5, true));
  const contexts = packed[0] % 9, low = (packed[0] / 9 | 0) % 5, mask = (1 << (packed[0] / 45 | 0)) - 1;
  const odds = new Uint16Array(LITERAL + (0x300 << contexts + low)).fill(1024);
  let range = 0xffffffff, code = head.getUint32(14), at = 18;
  // The range stays below 2^32 and is a number without a sign: `>>> 0` after each step of 32 bits.
  const wider = () => {
    if (range < 0x1000000) {
      range = range << 8 >>> 0;
      code = (code << 8 | packed[at++]) >>> 0;
    }
  };
  const bit = (i) => {
    wider();
    const odd = odds[i], split = (range >>> 11) * odd;
    if (code < split) {
      range = split;
      odds[i] = odd + (2048 - odd >> 5);
      return 0;
    }
    range -= split;
    code -= split;
    odds[i] = odd - (odd >> 5);
    return 1;
  };
  const tree = (base, bits) => {
    let node = 1;
    for (let i = 0; i < bits; i++) node = node << 1 | bit(base + node);
    return node - (1 << bits);
  };
  const backward = (base, bits) => {
    let node = 1, value = 0;
    for (let i = 0; i < bits; i++) {
      const one = bit(base + node);
      node = node << 1 | one;
      value |= one << i;
    }
    return value;
  };
  const even = (bits) => {
    let value = 0;
    for (let i = 0; i < bits; i++) {
      wider();
      range >>>= 1;
      const one = code >= range;
      if (one) code -= range;
      value = 2 * value + one;
    }
    return value;
  };
  const length = (base, place) => !bit(base) ? tree(base + 2 + 8 * place, 3) : !bit(base + 1) ? 8 + tree(base + 130 + 8 * place, 3) : 16 + tree(base + 258, 8);
  let state = 0, n = 0, back = 0, second = 0, third = 0, fourth = 0;
  while (n < out.length) {
    const place = n & mask;
    if (!bit(MATCH + 16 * state + place)) {
      const before = n > 0 ? out[n - 1] : 0, base = LITERAL + 0x300 * (((n & (1 << low) - 1) << contexts) + (before >> 8 - contexts));
      let node = 1;
      for (let match = state < 7 ? undefined : out[n - back - 1]; match !== undefined && node < 256;) {
        const expected = match >> 7 & 1, one = bit(base + 256 + 256 * expected + node);
        node = node << 1 | one;
        match = one === expected ? match << 1 : undefined;
      }
      while (node < 256) node = node << 1 | bit(base + node);
      out[n++] = node;
      state = state < 4 ? 0 : state < 10 ? state - 3 : state - 6;
      continue;
    }
    let count;
    if (bit(REPEAT + state)) {
      if (!bit(FIRST + state)) {
        if (!bit(LONG + 16 * state + place)) {
          state = state < 7 ? 9 : 11;
          out[n] = out[n - back - 1];
          n++;
          continue;
        }
      } else {
        const last = back;
        if (!bit(SECOND + state)) back = second;
        else {
          if (!bit(THIRD + state)) back = third;
          else { back = fourth; fourth = third; }
          third = second;
        }
        second = last;
      }
      count = length(OLD, place);
      state = state < 7 ? 8 : 11;
    } else {
      count = length(NEW, place);
      const slot = tree(SLOT + 64 * Math.min(count, 3), 6), bits = (slot >> 1) - 1, start = (2 | slot & 1) << bits;
      fourth = third;
      third = second;
      second = back;
      back = slot < 4 ? slot : slot < 14 ? start + backward(SPECIAL + start - slot, bits) : start + 16 * even(bits - 4) + backward(ALIGN, 4);
      state = state < 7 ? 7 : 10;
    }
    for (count += 2; count > 0; count--, n++) out[n] = out[n - back - 1];
  }
  return out;
}
