// Colour maps that colour-blind people can read: viridis and cividis, 33 stops each (published by their authors as CC0).

const STOPS = {
  viridis:
    "440154 470d60 48186a 482374 472d7b 453781 424086 3e4989 3b528b 375b8d 33638d 2f6b8e 2c728e 297a8e 26828e 23898e 21918c 1f988b 1fa088 22a785 28ae80 32b67a 3fbc73 4ec36b 5ec962 70cf57 84d44b 98d83e addc30 c2df23 d8e219 ece51b fde725",
  cividis:
    "00224e 00285b 002e6a 053371 1a386f 273e6e 32436d 3b496c 434e6c 4b546c 535a6d 5a5f6e 61656f 686a71 6f7073 767676 7d7c78 848279 8c8878 938e78 9b9476 a39a74 aba072 b4a76f bcae6c c4b468 cdbb63 d5c25e dec958 e7d150 f0d846 f9e03a fee838",
};

const tables = {};

function table(name) {
  if (!tables[name]) {
    const stops = STOPS[name].split(" ").map((hex) => [0, 2, 4].map((k) => parseInt(hex.slice(k, k + 2), 16)));
    const full = new Uint8Array(256 * 3);
    for (let i = 0; i < 256; i++) {
      const at = (i / 255) * (stops.length - 1);
      const low = Math.min(Math.floor(at), stops.length - 2);
      for (let k = 0; k < 3; k++) full[3 * i + k] = stops[low][k] + (at - low) * (stops[low + 1][k] - stops[low][k]);
    }
    tables[name] = full;
  }
  return tables[name];
}

// Colours (3 bytes each) of values between low and high; values that are no number get `none`.
export function colours(values, low, high, name = "viridis", none = [150, 150, 155]) {
  const map = table(name);
  const out = new Uint8Array(values.length * 3);
  const scale = high > low ? 255 / (high - low) : 0;
  for (let i = 0; i < values.length; i++) {
    const value = values[i];
    if (!Number.isFinite(value)) {
      out.set(none, 3 * i);
      continue;
    }
    const k = Math.max(0, Math.min(255, Math.round((value - low) * scale)));
    out[3 * i] = map[3 * k];
    out[3 * i + 1] = map[3 * k + 1];
    out[3 * i + 2] = map[3 * k + 2];
  }
  return out;
}

export function gradient(name = "viridis") {
  const map = table(name);
  const parts = [];
  for (let i = 0; i <= 8; i++) {
    const k = Math.round((i * 255) / 8);
    parts.push(`rgb(${map[3 * k]},${map[3 * k + 1]},${map[3 * k + 2]})`);
  }
  return `linear-gradient(to right, ${parts.join(",")})`;
}

// The range that holds all but a `cut` share of the finite values at each end.
export function spread(values, cut = 0.01) {
  const finite = Float64Array.from(values).filter(Number.isFinite).sort();
  if (!finite.length) return [0, 1];
  const low = finite[Math.floor(cut * (finite.length - 1))];
  const high = finite[Math.ceil((1 - cut) * (finite.length - 1))];
  return high > low ? [low, high] : [low, low + (Math.abs(low) * 1e-3 || 1e-3)];
}
