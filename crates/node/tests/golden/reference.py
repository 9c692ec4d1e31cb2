"""Makes the golden vectors of all schemes but the adaptive ones anew, by their definitions, and compares them: reference.py FOLDER."""
import math
import struct
import sys

MASK = (1 << 64) - 1


class Signal:
    """SplitMix64 from 1."""

    def __init__(self):
        self.state = 1

    def random(self):
        self.state = (self.state + 0x9E3779B97F4A7C15) & MASK
        z = self.state
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & MASK
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & MASK
        return z ^ (z >> 31)

    def whole(self, bits):
        return (self.random() >> (64 - bits)) - (1 << (bits - 1))

    def multiple(self):
        return self.whole(12) / 64


def word(value, bits):
    return bytes([bits, value << (8 - bits)])


def sample_if(speaks, x):
    return bytes([64]) + struct.pack(">d", x) if speaks else b"\0"


def cell(thresholds, x):
    return sum(threshold <= x for threshold in thresholds)


WORDS = [0, 1, 3, 2, 6, 7]
estimate = [20.0, 0.0]


def sign_bit(s):
    x, t = s.multiple(), s.multiple()
    return struct.pack("<dd", x, t) + word(x >= t, 1)


def sign_bit_codes(s):
    x, t = s.whole(16), s.whole(14)
    return struct.pack("<ii", x, t) + word(x >= t, 1)


def innovation_word(s):
    x, mean, deviation = s.multiple(), s.multiple(), abs(s.multiple()) + 0.25
    return struct.pack("<ddd", x, mean, deviation) + word(cell([-0.982, 0, 0.982], (x - mean) / deviation), 2)


def innovation_word_codes(s):
    x, mean, deviation = s.whole(16), s.whole(14), abs(s.whole(12)) + 1
    index = sum(t * deviation <= (x - mean) << 16 for t in [-64356, 0, 64356])
    return struct.pack("<iiI", x, mean, deviation) + word(index, 2)


def quantizer_word(s):
    x = s.multiple()
    return struct.pack("<d", x) + word(WORDS[cell([-20, -5, 0, 5, 20], x)], 3)


def quantizer_word_codes(s):
    x = s.whole(16) + 0x8000
    return struct.pack("<H", x) + word(WORDS[cell([8000, 24000, 32768, 40000, 60000], x)], 3)


def pattern_bit(s):
    x = s.multiple()
    return struct.pack("<d", x) + word(cell([-10, 0, 10], x) % 2, 1)


def range_level(s):
    x, centre, half = s.multiple(), s.multiple(), abs(s.multiple()) + 0.125
    level = min(7, max(0, math.floor(((x - centre) / half + 1) * 4)))
    return struct.pack("<ddd", x, centre, half) + word(level, 3)


def range_level_codes(s):
    x, centre, half = s.whole(16), s.whole(14), abs(s.whole(15))
    return struct.pack("<iiI", x, centre, half) + word(sum((x - centre) * 8 >= half * (2 * q - 8) for q in range(1, 8)), 3)


def censoring(s):
    x, p, half = s.multiple(), s.multiple(), abs(s.multiple())
    return struct.pack("<ddd", x, p, half) + sample_if(abs(x - p) >= half, x)


def censoring_codes(s):
    x, p, half = s.whole(16), s.whole(14), abs(s.whole(15))
    return struct.pack("<iiI", x, p, half) + (bytes([16]) + struct.pack(">H", x & 0xFFFF) if abs(x - p) >= half else b"\0")


def censoring_told(s):
    x, p = s.multiple(), s.multiple()
    a, b, d = abs(s.multiple()) + 1, s.multiple() / 64, abs(s.multiple()) + 1
    innovation = a + b * 0.5 + (b + d * 0.5) * 0.5 + 0.25
    return struct.pack("<ddddd", x, p, a, b, d) + sample_if(abs(x - p) >= math.sqrt(2 * innovation), x)


def censoring_own(s):
    x = 20 + s.multiple() / 2
    predicted = [estimate[0] + estimate[1], 0.9 * estimate[1]]
    innovation = x - predicted[0]
    estimate[:] = [predicted[0] + 0.5 * innovation, predicted[1] + 0.2 * innovation]
    return struct.pack("<d", x) + sample_if(abs(innovation) >= 8, x)


def trigger(s):
    x, p, uniform = s.multiple(), s.multiple(), (s.random() >> 11) / 2**53
    return struct.pack("<ddd", x, p, uniform) + sample_if(uniform < -math.expm1(-0.5 * (x - p) ** 2 * 0.01), x)


SCHEMES = {
    "sign-bit": (1, 16, sign_bit),
    "sign-bit-codes": (2, 8, sign_bit_codes),
    "innovation-word": (3, 24, innovation_word),
    "innovation-word-codes": (4, 12, innovation_word_codes),
    "quantizer-word": (5, 8, quantizer_word),
    "quantizer-word-codes": (6, 2, quantizer_word_codes),
    "pattern-bit": (7, 8, pattern_bit),
    "range-level": (8, 24, range_level),
    "censoring": (9, 24, censoring),
    "censoring-codes": (10, 12, censoring_codes),
    "censoring-told": (11, 40, censoring_told),
    "censoring-own": (12, 8, censoring_own),
    "trigger": (13, 24, trigger),
    "range-level-codes": (16, 12, range_level_codes),
}

failed = False
for name, (number, width, record) in SCHEMES.items():
    signal = Signal()
    expected = b"fbgv" + struct.pack("<BBHI", 2, number, width, 300) + b"".join(record(signal) for _ in range(300))
    with open(f"{sys.argv[1]}/{name}.bin", "rb") as file:
        if file.read() != expected:
            print(f"{name}: not as defined")
            failed = True
print("failed" if failed else f"{len(SCHEMES)} files are as defined")
sys.exit(failed)
