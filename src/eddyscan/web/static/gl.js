// Drawing with WebGL 2: lit triangles, round points and lines of a stated width, nothing more.

const MESH = [
  `#version 300 es
  uniform mat4 mvp; in vec3 at; in vec3 normal; in vec3 colour; out vec3 n; out vec3 c;
  void main() { gl_Position = mvp * vec4(at, 1.0); n = normal; c = colour; }`,
  `#version 300 es
  precision mediump float; uniform vec3 light; uniform float shine; in vec3 n; in vec3 c; out vec4 pixel;
  void main() { float d = abs(dot(normalize(n), light)); pixel = vec4(c * mix(1.0, 0.35 + 0.72 * d, shine), 1.0); }`,
];

const POINTS = [
  `#version 300 es
  uniform mat4 mvp; uniform float px; uniform float mmPx; uniform float lift; in vec3 at; in vec3 colour; out vec3 c;
  void main() { gl_Position = mvp * vec4(at, 1.0); gl_PointSize = max(px, mmPx / gl_Position.w);
    gl_Position.z -= lift * gl_Position.w; c = colour; }`,
  `#version 300 es
  precision mediump float; in vec3 c; out vec4 pixel;
  void main() { vec2 d = gl_PointCoord - 0.5; if (dot(d, d) > 0.25) discard; pixel = vec4(c, 1.0); }`,
];

const LINES = [
  `#version 300 es
  uniform mat4 mvp; uniform vec2 size; uniform float width; uniform float lift;
  in vec3 from; in vec3 to; in vec3 fromColour; in vec3 toColour; out vec3 c;
  void main() {
    int k = gl_VertexID; bool end = k == 1 || k == 2 || k == 4; float side = (k == 0 || k == 1 || k == 3) ? -1.0 : 1.0;
    vec4 a = mvp * vec4(from, 1.0); vec4 b = mvp * vec4(to, 1.0);
    vec2 along = normalize((b.xy / b.w - a.xy / a.w) * size + vec2(1e-6, 0.0));
    vec4 p = end ? b : a;
    p.xy += vec2(-along.y, along.x) * side * width / size * p.w;
    p.z -= lift * p.w; gl_Position = p; c = end ? toColour : fromColour; }`,
  `#version 300 es
  precision mediump float; in vec3 c; out vec4 pixel; void main() { pixel = vec4(c, 1.0); }`,
];

export class Painter {
  constructor(canvas) {
    this.canvas = canvas;
    this.gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    if (!this.gl) throw new Error("this browser has no WebGL 2");
    this.mesh = this.program(MESH);
    this.points = this.program(POINTS);
    this.lines = this.program(LINES);
    this.gl.enable(this.gl.DEPTH_TEST);
  }

  program([vertex, fragment]) {
    const gl = this.gl;
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const uniforms = {};
    for (let k = 0; k < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); k++) {
      const { name } = gl.getActiveUniform(program, k);
      uniforms[name] = gl.getUniformLocation(program, name);
    }
    return { program, uniforms };
  }

  buffer(data, target = this.gl.ARRAY_BUFFER) {
    const made = this.gl.createBuffer();
    this.gl.bindBuffer(target, made);
    this.gl.bufferData(target, data, this.gl.DYNAMIC_DRAW);
    return made;
  }

  drop(thing) {
    for (const buffer of thing ? Object.values(thing.buffers) : []) this.gl.deleteBuffer(buffer);
  }

  makeMesh(vertices, normals, faces, colours) {
    const buffers = { at: this.buffer(vertices), normal: this.buffer(normals), colour: this.buffer(colours) };
    buffers.faces = this.buffer(faces, this.gl.ELEMENT_ARRAY_BUFFER);
    return { buffers, count: faces.length };
  }

  makePoints(positions, colours) {
    return { buffers: { at: this.buffer(positions), colour: this.buffer(colours) }, count: positions.length / 3 };
  }

  // Segments: positions (2 per segment) and colours (2 per segment).
  makeLines(positions, colours) {
    return { buffers: { at: this.buffer(positions), colour: this.buffer(colours) }, count: positions.length / 6 };
  }

  recolour(thing, colours) {
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, thing.buffers.colour);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, colours, this.gl.DYNAMIC_DRAW);
  }

  begin(background) {
    const gl = this.gl;
    const scale = Math.min(devicePixelRatio || 1, 2);
    const width = Math.max(1, Math.round(this.canvas.clientWidth * scale));
    const height = Math.max(1, Math.round(this.canvas.clientHeight * scale));
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
    this.scale = scale;
    gl.viewport(0, 0, width, height);
    gl.clearColor(...background, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  }

  attribute(program, name, buffer, { bytes = false, stride = 0, offset = 0, divisor = 0 } = {}) {
    const gl = this.gl;
    const place = gl.getAttribLocation(program, name);
    if (place < 0) return;
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, 3, bytes ? gl.UNSIGNED_BYTE : gl.FLOAT, bytes, stride, offset);
    gl.vertexAttribDivisor(place, divisor);
  }

  drawMesh(thing, mvp, light, shine = 1) {
    const gl = this.gl;
    const { program, uniforms } = this.mesh;
    gl.useProgram(program);
    gl.uniformMatrix4fv(uniforms.mvp, false, mvp);
    gl.uniform3fv(uniforms.light, light);
    gl.uniform1f(uniforms.shine, shine);
    this.attribute(program, "at", thing.buffers.at);
    this.attribute(program, "normal", thing.buffers.normal);
    this.attribute(program, "colour", thing.buffers.colour, { bytes: true });
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, thing.buffers.faces);
    gl.drawElements(gl.TRIANGLES, thing.count, gl.UNSIGNED_INT, 0);
  }

  drawPoints(thing, mvp, { px = 4, mm = 0, lift = 0.002, mmScale = 0 } = {}) {
    const gl = this.gl;
    const { program, uniforms } = this.points;
    gl.useProgram(program);
    gl.uniformMatrix4fv(uniforms.mvp, false, mvp);
    gl.uniform1f(uniforms.px, px * this.scale);
    gl.uniform1f(uniforms.mmPx, mm * mmScale * this.canvas.height);
    gl.uniform1f(uniforms.lift, lift);
    this.attribute(program, "at", thing.buffers.at);
    this.attribute(program, "colour", thing.buffers.colour, { bytes: true });
    gl.drawArrays(gl.POINTS, 0, thing.count);
  }

  drawLines(thing, mvp, { px = 2, lift = 0.001 } = {}) {
    const gl = this.gl;
    const { program, uniforms } = this.lines;
    gl.useProgram(program);
    gl.uniformMatrix4fv(uniforms.mvp, false, mvp);
    gl.uniform2f(uniforms.size, this.canvas.width, this.canvas.height);
    gl.uniform1f(uniforms.width, px * this.scale);
    gl.uniform1f(uniforms.lift, lift);
    const { at, colour } = thing.buffers;
    this.attribute(program, "from", at, { stride: 24, offset: 0, divisor: 1 });
    this.attribute(program, "to", at, { stride: 24, offset: 12, divisor: 1 });
    this.attribute(program, "fromColour", colour, { bytes: true, stride: 6, offset: 0, divisor: 1 });
    this.attribute(program, "toColour", colour, { bytes: true, stride: 6, offset: 3, divisor: 1 });
    gl.drawArraysInstanced(gl.TRIANGLES, 0, 6, thing.count);
    for (const name of ["from", "to", "fromColour", "toColour"]) {
      const place = gl.getAttribLocation(program, name);
      gl.vertexAttribDivisor(place, 0);
      gl.disableVertexAttribArray(place);
    }
  }
}
