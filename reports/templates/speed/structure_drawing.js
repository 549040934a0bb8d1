"use strict";
// Draws lists of vertices (x y z, r g b a) by WebGL, or on a plain canvas where it is missing.
// Both have fill({triangles, thin, strong}) and draw(matrix, walking).

// A 4 x 4 matrix, column by column: turned about the centre, seen in perspective.
function viewMatrix(canvas, state, scene) {
  const aspect = canvas.width / canvas.height;
  const [cy, sy] = [Math.cos(state.yaw), Math.sin(state.yaw)];
  const [cp, sp] = [Math.cos(state.pitch), Math.sin(state.pitch)];
  const rows = [[cy, sy, 0], [-sy * sp, cy * sp, cp], [sy * cp, -cy * cp, sp]];
  const distance = 3.2, near = 0.5, far = 12, f = (3.9 * state.zoom) / scene.radius;
  const size = [f / Math.max(aspect, 1), f * Math.min(aspect, 1)];
  const at = rows.map((r) => -r.reduce((a, v, k) => a + v * scene.centre[k], 0));
  const s = 1 / scene.radius, depth = (far + near) / (far - near);
  const m = new Float32Array(16);
  for (let k = 0; k < 4; k++) {
    const [x, y, z] = rows.map((r, j) => (k < 3 ? r[k] : at[j]));
    m[4 * k] = size[0] * x;
    m[4 * k + 1] = size[1] * y;
    m[4 * k + 3] = (k === 3 ? distance : 0) - s * z;
    m[4 * k + 2] = depth * m[4 * k + 3] - (k === 3 ? (2 * far * near) / (far - near) : 0);
  }
  return m;
}

function drawerWebGl(canvas) {
  const gl = canvas.getContext("webgl", { antialias: true, preserveDrawingBuffer: true });
  if (!gl) return null;
  const program = gl.createProgram();
  const sources = [
    [gl.VERTEX_SHADER, `attribute vec3 place; attribute vec4 colour; uniform mat4 m;
      uniform vec2 shift; varying vec4 shown;
      void main() { gl_Position = m * vec4(place, 1.0);
        gl_Position.xy += shift * gl_Position.w; shown = colour; }`],
    [gl.FRAGMENT_SHADER, `precision mediump float; varying vec4 shown; uniform float alpha;
      void main() { gl_FragColor = vec4(shown.rgb, shown.a * alpha); }`],
  ];
  for (const [kind, source] of sources) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  gl.useProgram(program);
  gl.enable(gl.BLEND);
  gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  const uniform = (name) => gl.getUniformLocation(program, name);
  const buffers = {};
  const count = {};
  return {
    fill(lists) {
      for (const [name, list] of Object.entries(lists)) {
        buffers[name] = buffers[name] || gl.createBuffer();
        gl.bindBuffer(gl.ARRAY_BUFFER, buffers[name]);
        gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(list), gl.STATIC_DRAW);
        count[name] = list.length / 7;
      }
    },
    draw(m, walking) {
      const run = (name, kind, alpha, tested, shift = [0, 0]) => {
        gl.bindBuffer(gl.ARRAY_BUFFER, buffers[name]);
        for (const [field, size, start] of [["place", 3, 0], ["colour", 4, 12]]) {
          const at = gl.getAttribLocation(program, field);
          gl.enableVertexAttribArray(at);
          gl.vertexAttribPointer(at, size, gl.FLOAT, false, 28, start);
        }
        gl.uniformMatrix4fv(uniform("m"), false, m);
        gl.uniform2fv(uniform("shift"), shift);
        gl.uniform1f(uniform("alpha"), alpha);
        (tested ? gl.enable : gl.disable).call(gl, gl.DEPTH_TEST);
        gl.drawArrays(kind, 0, count[name]);
      };
      gl.viewport(0, 0, canvas.width, canvas.height);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      run("triangles", gl.TRIANGLES, 1, true);
      run("thin", gl.LINES, walking ? 1 : 0.25, false); // what the mesh hides, faintly
      const [x, y] = [2 / canvas.width, 2 / canvas.height];
      if (!walking) {
        run("thin", gl.LINES, 1, true);
        run("thin", gl.LINES, 0.6, true, [x / 2, y / 2]);
      }
      for (const shift of [[0, 0], [x, 0], [-x, 0], [0, y], [0, -y]]) {
        run("strong", gl.LINES, 1, false, shift);
      }
    },
  };
}
function drawer2d(canvas) {
  const context = canvas.getContext("2d");
  let kept = null;
  const css = (v, k) =>
    `rgba(${v.slice(k + 3, k + 6).map((c) => Math.round(255 * c))},${v[k + 6]})`;
  return {
    fill(lists) { kept = lists; },
    draw(m) {
      const to = (v, k) => {
        const [x, y, , w] = [0, 1, 2, 3].map(
          (r) => m[r] * v[k] + m[4 + r] * v[k + 1] + m[8 + r] * v[k + 2] + m[12 + r]);
        return [(1 + x / w) * canvas.width / 2, (1 - y / w) * canvas.height / 2, w];
      };
      context.clearRect(0, 0, canvas.width, canvas.height);
      const faces = [];
      const t = kept.triangles;
      for (let k = 0; k < t.length; k += 21) {
        const corners = [to(t, k), to(t, k + 7), to(t, k + 14)];
        faces.push([corners[0][2] + corners[1][2] + corners[2][2], corners, css(t, k)]);
      }
      faces.sort((a, b) => b[0] - a[0]); // far ones first
      for (const [, corners, colour] of faces) {
        context.fillStyle = colour;
        context.beginPath();
        for (const [x, y] of corners) context.lineTo(x, y);
        context.fill();
      }
      for (const [list, width] of [[kept.thin, 1], [kept.strong, 3]]) {
        context.lineWidth = width;
        for (let k = 0; k < list.length; k += 14) {
          const [a, b] = [to(list, k), to(list, k + 7)];
          context.strokeStyle = css(list, k);
          context.beginPath();
          context.moveTo(a[0], a[1]);
          context.lineTo(b[0], b[1]);
          context.stroke();
        }
      }
    },
  };
}

function structureDrawer(canvas, wanted) {
  return (wanted !== "2d" && drawerWebGl(canvas)) || drawer2d(canvas);
}
