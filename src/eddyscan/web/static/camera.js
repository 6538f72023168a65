// An orbiting camera: z is up, drag turns, two fingers or right button shift, wheel comes nearer. Keys do the same.

const FIELD = Math.PI / 5;

export class Camera {
  constructor() {
    this.target = [0, 0, 0];
    this.yaw = -1.1;
    this.pitch = 0.75;
    this.distance = 400;
    this.radius = 150;
  }

  fit([low, high]) {
    this.target = low.map((value, k) => (value + high[k]) / 2);
    this.radius = Math.max(1, Math.hypot(...low.map((value, k) => high[k] - value)) / 2);
    this.distance = (1.12 * this.radius) / Math.sin(FIELD / 2) / Math.min(1, (this.aspect || 1) * 1.05);
  }

  look(name) {
    const poses = { top: [-Math.PI / 2, 1.5607], front: [-Math.PI / 2, 0.12], corner: [-1.1, 0.75] };
    [this.yaw, this.pitch] = poses[name];
  }

  turn(dx, dy) {
    this.yaw -= dx * 0.008;
    this.pitch = Math.max(-1.56, Math.min(1.5607, this.pitch + dy * 0.008));
  }

  shift(dx, dy, height) {
    const scale = (2 * this.distance * Math.tan(FIELD / 2)) / height;
    const { right, up } = this.axes();
    for (let k = 0; k < 3; k++) this.target[k] += scale * (dy * up[k] - dx * right[k]);
  }

  zoom(factor) {
    this.distance = Math.max(this.radius * 0.05, Math.min(this.radius * 20, this.distance * factor));
  }

  axes() {
    const [sy, cy, sp, cp] = [Math.sin(this.yaw), Math.cos(this.yaw), Math.sin(this.pitch), Math.cos(this.pitch)];
    return { back: [cp * cy, cp * sy, sp], right: [-sy, cy, 0], up: [-sp * cy, -sp * sy, cp] };
  }

  // The matrix (column-major) and what picking needs.
  matrix(aspect) {
    this.aspect = aspect;
    const { back, right, up } = this.axes();
    const eye = this.target.map((value, k) => value + this.distance * back[k]);
    const near = Math.max(this.distance - 6 * this.radius, this.distance * 0.02);
    const far = this.distance + 6 * this.radius;
    const f = 1 / Math.tan(FIELD / 2);
    const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    const rows = [
      [...right.map((v) => (v * f) / aspect), (-dot(right, eye) * f) / aspect],
      [...up.map((v) => v * f), -dot(up, eye) * f],
      depthRow(back, eye, near, far, dot),
      [...back.map((v) => -v), dot(back, eye)],
    ];
    const m = new Float32Array(16);
    for (let r = 0; r < 4; r++) for (let c = 0; c < 4; c++) m[4 * c + r] = rows[r][c];
    this.eye = eye;
    this.focal = f;
    this.m = m;
    return m;
  }

  // Part position [mm] -> [x px, y px, depth] on a canvas of this size.
  project(point, width, height) {
    const m = this.m;
    const w = m[3] * point[0] + m[7] * point[1] + m[11] * point[2] + m[15];
    const x = m[0] * point[0] + m[4] * point[1] + m[8] * point[2] + m[12];
    const y = m[1] * point[0] + m[5] * point[1] + m[9] * point[2] + m[13];
    return [(0.5 + (0.5 * x) / w) * width, (0.5 - (0.5 * y) / w) * height, w];
  }
}

function depthRow(back, eye, near, far, dot) {
  const a = (far + near) / (near - far);
  const b = (2 * far * near) / (near - far);
  return [...back.map((v) => a * v), -a * dot(back, eye) + b];
}
