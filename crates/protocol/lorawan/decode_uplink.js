// Decoder of fewbits frames (docs/wire.md) by LoRa Alliance TS013, for ChirpStack, The Things Stack and other network servers: one file,
// plain JavaScript (ECMAScript 5). Paste it as the uplink formatter of the device.
//
// data: kind, slot (modulo 2^24), digest (8 hexadecimal digits), bits (number of bits of the payload), payload (hexadecimal), for payloads of
// 1 to 32 bits word (the bits as a number, first bit highest), for payloads of 64 bits value (an IEEE double).

var KINDS = ["feedback", "report", "echo", "snapshot", "request", "handover", "heartbeat", "acknowledgement"];

function hex(bytes) {
  var text = "";
  for (var i = 0; i < bytes.length; i++) {
    text += (bytes[i] < 16 ? "0" : "") + bytes[i].toString(16);
  }
  return text;
}

// CRC-16 of IEEE 802.15.4: polynomial 0x1021, from zero, not reflected.
function crc16(bytes, end) {
  var sum = 0;
  for (var i = 0; i < end; i++) {
    sum ^= bytes[i] << 8;
    for (var bit = 0; bit < 8; bit++) {
      sum = sum & 0x8000 ? ((sum << 1) ^ 0x1021) & 0xffff : sum << 1;
    }
  }
  return sum;
}

function double(bytes) {
  var sign = bytes[0] & 0x80 ? -1 : 1;
  var exponent = ((bytes[0] & 0x7f) << 4) | (bytes[1] >> 4);
  var fraction = bytes[1] & 15;
  for (var i = 2; i < 8; i++) {
    fraction = fraction * 256 + bytes[i];
  }
  if (exponent === 2047) {
    return null;
  }
  if (exponent === 0) {
    return sign * fraction * Math.pow(2, -1074);
  }
  return sign * (fraction + Math.pow(2, 52)) * Math.pow(2, exponent - 1075);
}

function refused(reason) {
  return { errors: [reason] };
}

function decodeUplink(input) {
  var bytes = input.bytes;
  if (bytes.length === 0) {
    return refused("too short");
  }
  var version = bytes[0] >> 6;
  if (version !== 1) {
    return refused("version " + version + " of the frame: this decoder understands 1");
  }
  var number = (bytes[0] >> 3) & 7;
  var padding = bytes[0] & 7;
  var header = number === 5 ? 12 : 8;
  var end = bytes.length - 2;
  if (end < header) {
    return refused("too short");
  }
  if (crc16(bytes, end) !== ((bytes[end] << 8) | bytes[end + 1])) {
    return refused("check");
  }
  var payload = bytes.slice(header, end);
  var bits = 8 * payload.length - padding;
  if (bits < 0 || (padding > 0 && payload[payload.length - 1] & ((1 << padding) - 1))) {
    return refused("padding");
  }
  var data = {
    kind: KINDS[number],
    slot: bytes[1] * 65536 + bytes[2] * 256 + bytes[3],
    digest: hex(bytes.slice(4, 8)),
    bits: bits,
    payload: hex(payload)
  };
  if (bits >= 1 && bits <= 32) {
    var word = 0;
    for (var i = 0; i < payload.length; i++) {
      word = word * 256 + payload[i];
    }
    data.word = Math.floor(word / Math.pow(2, padding));
  }
  if (bits === 64) {
    data.value = double(payload);
  }
  return { data: data };
}

if (typeof module !== "undefined") {
  module.exports = { decodeUplink: decodeUplink };
}
