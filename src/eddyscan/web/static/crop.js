// The crop box: six handles, one per side, dragged along their axis; the numbers beside the picture do the same.

const INK = [230, 90, 0];
const REACH_PX = 26;
const EDGES = [0, 1, 0, 2, 0, 4, 1, 3, 1, 5, 2, 3, 2, 6, 3, 7, 4, 5, 4, 6, 5, 7, 6, 7];

export class CropBox {
  constructor(viewer) {
    this.viewer = viewer;
    this.box = null; // [[low x, high x], [low y, high y], [low z, high z]] in mm
    this.held = null;
    this.onChange = () => {};
    this.onRelease = () => {};
  }

  set(box) {
    this.box = box ? box.map((side) => [...side]) : null;
    this.viewer.redraw();
  }

  handles() {
    if (!this.box) return [];
    const middle = this.box.map(([low, high]) => (low + high) / 2);
    return [0, 1, 2].flatMap((axis) =>
      [0, 1].map((side) => {
        const at = [...middle];
        at[axis] = this.box[axis][side];
        return { axis, side, at };
      }),
    );
  }

  take(x, y) {
    const found = this.handles()
      .map((handle) => ({ handle, at: this.viewer.onScreen(handle.at) }))
      .map(({ handle, at }) => ({ handle, far: Math.hypot(at[0] - x, at[1] - y) }))
      .filter(({ far }) => far < REACH_PX)
      .sort((a, b) => a.far - b.far)[0];
    this.held = found ? found.handle : null;
    return Boolean(found);
  }

  drag(dx, dy) {
    const { axis, side, at } = this.held;
    const ahead = [...at];
    ahead[axis] += 1;
    const [a, b] = [this.viewer.onScreen(at), this.viewer.onScreen(ahead)];
    const along = [b[0] - a[0], b[1] - a[1]];
    const length = along[0] ** 2 + along[1] ** 2;
    if (length < 1e-4) return; // the axis points at the eye
    const [low, high] = this.box[axis];
    const wanted = at[axis] + (dx * along[0] + dy * along[1]) / length;
    at[axis] = side === 0 ? Math.min(wanted, high - 1) : Math.max(wanted, low + 1);
    this.box[axis][side] = at[axis];
    this.onChange(this.box);
  }

  release() {
    this.held = null;
    this.onRelease(this.box);
  }

  draw(painter, mvp) {
    if (!this.box) return;
    const corner = (k) => [0, 1, 2].map((axis) => this.box[axis][(k >> axis) & 1]);
    const at = new Float32Array(EDGES.flatMap(corner));
    const lines = painter.makeLines(at, inked(at.length));
    painter.drawLines(lines, mvp, { px: 2, lift: 0.002 });
    const spots = new Float32Array(this.handles().flatMap((handle) => handle.at));
    const points = painter.makePoints(spots, inked(spots.length));
    painter.drawPoints(points, mvp, { px: 22, lift: 0.05 });
    painter.drop(lines);
    painter.drop(points);
  }
}

function inked(length) {
  return Uint8Array.from({ length }, (_, k) => INK[k % 3]);
}
