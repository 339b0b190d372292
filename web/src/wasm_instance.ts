// The page's WebAssembly, as a worker runs it.

/** An instance of its own memory. */
export async function instance_of(code: WebAssembly.Module | BufferSource): Promise<WebAssembly.Instance> {
  const ends = (status: number) => {
    throw new Error(`the simulation ended with ${status}`);
  };
  const module = code instanceof WebAssembly.Module ? code : await WebAssembly.compile(code);
  const instance = await WebAssembly.instantiate(module, {
    env: { emscripten_notify_memory_growth: () => {} },
    wasi_snapshot_preview1: { proc_exit: ends, environ_sizes_get: () => 52, environ_get: () => 52 }, // there is none
  });
  (instance.exports as { _initialize?(): void })._initialize?.();
  return instance;
}
