// Renders rows of the picture. Each worker has a Python of its own.
let python = null;

async function load(address) {
  const { loadPyodide } = await import(address + "pyodide.mjs");
  python = await loadPyodide({ indexURL: address });
  await python.loadPackage("numpy", { messageCallback: () => {} });
  const sources = await (await fetch("renderer.zip")).arrayBuffer();
  python.unpackArchive(sources, "zip");
  python.runPython("import stand_ins, rows");
}

function render({ xml, size, integrator, first, step }) {
  const rows = python.globals.get("rows");
  rows.begin(xml, size, integrator);
  for (let y = first; y < size; y += step) {
    const bytes = rows.row(y);
    const view = bytes.getBuffer("u8");
    const floats = new Float32Array(view.data.slice().buffer);
    view.release();
    bytes.destroy();
    postMessage({ row: y, floats });
  }
  rows.destroy();
}

onmessage = async (event) => {
  try {
    if (event.data.address) {
      await load(event.data.address);
      postMessage({ ready: true });
    } else {
      render(event.data);
      postMessage({ done: true });
    }
  } catch (error) {
    const lines = String(error.message || error).trim().split("\n");
    postMessage({ error: lines[lines.length - 1] });
  }
};
