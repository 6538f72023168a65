// The readings of one scan as growing columns; a reading that comes twice is kept once.

export const COLUMNS = ["row", "point", "time_s", "x_mm", "y_mm", "z_mm", "resistance_ohm", "reactance_ohm", "flag", "lift_off_mm"];

const KEPT = [...COLUMNS, "shown_s"];

export class Readings {
  constructor() {
    this.count = 0;
    this.room = 0;
    this.seen = new Map();
    this.offset = 0;
    this.columns = Object.fromEntries(KEPT.map((name) => [name, new Float64Array(0)]));
  }

  add(rows) {
    let news = 0;
    for (const row of rows) {
      const key = row[0] * 1e6 + row[1];
      if (this.seen.has(key)) continue;
      this.reserve(this.count + 1);
      COLUMNS.forEach((name, k) => {
        this.columns[name][this.count] = row[k] === null ? NaN : row[k];
      });
      this.seen.set(key, this.count);
      this.clock(this.count);
      this.count++;
      news++;
    }
    return news;
  }

  // A resumed scan's clock begins again: the chart's time goes on where it stopped.
  clock(k) {
    const { time_s: time, shown_s: shown } = this.columns;
    if (k && time[k] < time[k - 1]) this.offset = shown[k - 1] - time[k] + 1;
    shown[k] = time[k] + this.offset;
  }

  addTable(table, width = COLUMNS.length) {
    const rows = [];
    for (let k = 0; k < table.length; k += width) rows.push(Array.from(table.subarray(k, k + width)));
    return this.add(rows);
  }

  reserve(count) {
    if (count <= this.room) return;
    this.room = Math.max(1024, 2 * count);
    for (const name of KEPT) {
      const wider = new Float64Array(this.room);
      wider.set(this.columns[name]);
      this.columns[name] = wider;
    }
  }

  column(name) {
    return this.columns[name].subarray(0, this.count);
  }

  positions() {
    const at = new Float32Array(3 * this.count);
    for (let k = 0; k < this.count; k++) {
      at[3 * k] = this.columns.x_mm[k];
      at[3 * k + 1] = this.columns.y_mm[k];
      at[3 * k + 2] = this.columns.z_mm[k];
    }
    return at;
  }

  last() {
    if (!this.count) return null;
    const k = this.count - 1;
    return Object.fromEntries(COLUMNS.map((name) => [name, this.columns[name][k]]));
  }

  // Numbers of the readings within `radius` mm of a spot.
  near([x, y, z], radius) {
    const found = [];
    const { x_mm: X, y_mm: Y, z_mm: Z } = this.columns;
    for (let k = 0; k < this.count; k++) {
      if (Math.hypot(X[k] - x, Y[k] - y, Z[k] - z) <= radius) found.push(k);
    }
    return found;
  }
}
