// OpenGL's objects, as small classes. All are lost with their context.

type Value = number | boolean | readonly number[] | Float64Array;

export class Program {
  private readonly program: WebGLProgram;
  private readonly places = new Map<string, { place: WebGLUniformLocation; type: number }>();

  constructor(private readonly gl: WebGL2RenderingContext, vertex: string, fragment: string) {
    this.program = gl.createProgram()!;
    for (const [type, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]] as const) {
      const shader = gl.createShader(type)!;
      gl.shaderSource(shader, `#version 300 es\nprecision highp float;\nprecision highp int;\n${source}`);
      gl.compileShader(shader);
      gl.attachShader(this.program, shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost())
        throw new Error(`a shader does not compile: ${gl.getShaderInfoLog(shader)}`);
    }
    gl.linkProgram(this.program);
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS) && !gl.isContextLost())
      throw new Error(`a program does not link: ${gl.getProgramInfoLog(this.program)}`);
    const count = gl.getProgramParameter(this.program, gl.ACTIVE_UNIFORMS) ?? 0;
    for (let i = 0; i < count; ++i) {
      const { name, type } = gl.getActiveUniform(this.program, i)!;
      this.places.set(name.replace("[0]", ""), { place: gl.getUniformLocation(this.program, name)!, type });
    }
  }

  /** Makes it current and sets uniforms, of those that it has. */
  use(uniforms: Record<string, Value>): void {
    this.gl.useProgram(this.program);
    for (const [name, value] of Object.entries(uniforms)) this.set(name, value);
  }

  private set(name: string, value: Value): void {
    const { gl } = this, uniform = this.places.get(name);
    if (!uniform) return;
    const { place, type } = uniform;
    if (typeof value === "boolean") gl.uniform1i(place, value ? 1 : 0);
    else if (typeof value === "number") type === gl.FLOAT ? gl.uniform1f(place, value) : gl.uniform1i(place, value);
    else if (type === gl.FLOAT_VEC2) gl.uniform2fv(place, value);
    else if (type === gl.FLOAT_VEC3) gl.uniform3fv(place, value);
    else if (type === gl.FLOAT_VEC4) gl.uniform4fv(place, value);
    else if (type === gl.FLOAT_MAT3) gl.uniformMatrix3fv(place, false, value);
    else gl.uniformMatrix4fv(place, false, value);
  }
}

/** A texture that is never filtered. */
export class Texture {
  readonly id: WebGLTexture;
  width = 0;
  height = 0;

  constructor(private readonly gl: WebGL2RenderingContext, private readonly format: number, private readonly target: number = gl.TEXTURE_2D) {
    this.id = gl.createTexture()!;
    this.bind(0);
    for (const which of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(target, which, gl.NEAREST);
    for (const which of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(target, which, gl.CLAMP_TO_EDGE);
  }

  bind(unit: number): void {
    this.gl.activeTexture(this.gl.TEXTURE0 + unit);
    this.gl.bindTexture(this.target, this.id);
  }

  /** Draws into columns of a layer from now on: of the bound framebuffer. */
  draw_into(layer: number, x: number, width: number, height: number): void {
    const { gl } = this;
    gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, this.id, 0, layer);
    gl.viewport(x, 0, width, height);
  }

  private layout(): [number, number] {
    const { gl, format } = this;
    if (format === gl.R32F) return [gl.RED, gl.FLOAT];
    if (format === gl.RG32F) return [gl.RG, gl.FLOAT];
    if (format === gl.R8) return [gl.RED, gl.UNSIGNED_BYTE];
    if (format === gl.DEPTH_COMPONENT24) return [gl.DEPTH_COMPONENT, gl.UNSIGNED_INT];
    return [gl.RGBA, format === gl.RGBA8 ? gl.UNSIGNED_BYTE : gl.FLOAT];
  }

  resize(width: number, height: number): void {
    if (width === this.width && height === this.height) return;
    this.bind(0);
    this.gl.texImage2D(this.target, 0, this.format, width, height, 0, ...this.layout(), null);
    this.width = width;
    this.height = height;
  }

  fill(values: Float32Array | Uint8Array, x: number, y: number, width: number, height: number): void {
    this.bind(0);
    this.gl.pixelStorei(this.gl.UNPACK_ALIGNMENT, 1); // rows of bytes have any length
    this.gl.texSubImage2D(this.target, 0, x, y, width, height, ...this.layout(), values);
  }

  /** Throws where there is not enough memory for it. */
  resize_layers(width: number, height: number, layers: number): void {
    const { gl } = this;
    this.bind(0);
    while (gl.getError() !== gl.NO_ERROR && !gl.isContextLost()); // of earlier calls
    gl.texImage3D(this.target, 0, this.format, width, height, layers, 0, ...this.layout(), null);
    if (gl.getError() !== gl.NO_ERROR && !gl.isContextLost()) throw new Error("the graphics device has too little memory for the map");
  }

  /** Columns of texels in all layers. */
  fill_layers(values: Float32Array | Uint8Array, x: number, width: number, height: number, layers: number): void {
    this.bind(0);
    this.gl.texSubImage3D(this.target, 0, x, 0, 0, width, height, layers, ...this.layout(), values);
  }
}

/** A list of texels for the shaders' `entry`: 1024 a row. */
export class Table {
  private static readonly kWidth = 1024;
  private readonly texture: Texture;
  private padded = new Float32Array(0);

  constructor(gl: WebGL2RenderingContext) {
    this.texture = new Texture(gl, gl.RGBA32F);
  }

  bind(unit: number): void {
    this.texture.bind(unit);
  }

  fill(values: Float32Array): void {
    const row = 4 * Table.kWidth, rows = Math.max(1, Math.ceil(values.length / row));
    if (rows > this.texture.height) {
      this.texture.resize(Table.kWidth, Math.min(Math.ceil(1.5 * rows), Math.max(rows, 2048)));
      this.padded = new Float32Array(row * this.texture.height);
    }
    this.padded.set(values);
    this.texture.fill(this.padded.subarray(0, row * rows), 0, 0, Table.kWidth, rows);
  }
}

/** The red channel of the bound framebuffer, on its way. */
export class ComingReds {
  private readonly values: Float32Array;
  readonly stride: number; // of the reds in all values
  private readonly buffer: WebGLBuffer;
  private readonly drawn: WebGLSync;

  /** `format` is one that the framebuffer can be read in. */
  constructor(private readonly gl: WebGL2RenderingContext, width: number, height: number, format: number, private readonly taken: () => void) {
    this.stride = format === gl.RED ? 1 : 4;
    this.values = new Float32Array(this.stride * width * height);
    this.buffer = gl.createBuffer()!;
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.buffer);
    gl.bufferData(gl.PIXEL_PACK_BUFFER, this.values.byteLength, gl.STREAM_READ);
    gl.readPixels(0, 0, width, height, format, gl.FLOAT, 0);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    this.drawn = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0)!;
    gl.flush();
  }

  /** None until it is drawn, and where it never will be. It is taken once. */
  take(): Float32Array | null {
    const { stride } = this, values = this.take_all();
    return values && (stride === 1 ? values : values.filter((_, i) => i % stride === 0));
  }

  get is_lost(): boolean {
    return this.gl.isContextLost();
  }

  /** The same with what lies between the reds, the lowest row first. */
  take_all(): Float32Array | null {
    const { gl } = this, status = gl.clientWaitSync(this.drawn, 0, 0);
    if (status !== gl.ALREADY_SIGNALED && status !== gl.CONDITION_SATISFIED) return null;
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.buffer);
    gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, this.values);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    this.drop();
    this.taken();
    return this.values;
  }

  drop(): void {
    this.gl.deleteBuffer(this.buffer);
    this.gl.deleteSync(this.drawn);
  }
}

/** A framebuffer with textures of its own, all of one size. */
export class Target {
  private readonly framebuffer: WebGLFramebuffer;
  readonly textures: Texture[];
  private readonly depth: Texture | null;
  private red_format = 0; // in which reds are read; 0: not known yet

  constructor(private readonly gl: WebGL2RenderingContext, formats: number[], has_depth = false) {
    this.framebuffer = gl.createFramebuffer()!;
    this.textures = formats.map((format) => new Texture(gl, format));
    this.depth = has_depth ? new Texture(gl, gl.DEPTH_COMPONENT24) : null;
  }

  /** Draws into it from now on, all of it. */
  use(width: number, height: number): void {
    const { gl } = this, is_new = width !== this.textures[0]!.width || height !== this.textures[0]!.height;
    if (is_new) for (const texture of [...this.textures, this.depth]) texture?.resize(width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
    if (is_new) {
      this.textures.forEach((texture, i) =>
        gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + i, gl.TEXTURE_2D, texture.id, 0));
      if (this.depth) gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, this.depth.id, 0);
      gl.drawBuffers(this.textures.map((_, i) => gl.COLOR_ATTACHMENT0 + i));
    }
    gl.viewport(0, 0, width, height);
  }

  clear(): void {
    const { gl } = this;
    this.textures.forEach((_, i) => gl.clearBufferfv(gl.COLOR, i, [0, 0, 0, 0]));
    if (this.depth) gl.clearBufferfv(gl.DEPTH, 0, [1]);
  }

  /** The red channel, in any order, once the device has drawn it. */
  red_later(): ComingReds {
    const { gl } = this, { width, height } = this.textures[0]!;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
    return new ComingReds(gl, width, height, this.red_format || gl.RGBA, () => this.find_red_format());
  }

  /** Whether reds can be read alone. Asked for while the device has nothing to draw, since the answer waits for that. */
  private find_red_format(): void {
    const { gl } = this;
    if (this.red_format !== 0) return;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
    const reads_reds = gl.getParameter(gl.IMPLEMENTATION_COLOR_READ_FORMAT) === gl.RED && gl.getParameter(gl.IMPLEMENTATION_COLOR_READ_TYPE) === gl.FLOAT;
    this.red_format = reads_reds ? gl.RED : gl.RGBA;
  }

  /** The same at once, which waits for the device. */
  red(): Float32Array {
    const { gl } = this, { width, height } = this.textures[0]!, rgba = new Float32Array(4 * width * height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.FLOAT, rgba);
    return rgba.filter((_, i) => i % 4 === 0);
  }
}

/** Triangles on the GPU: points, their normals, and weights, which are 1 where there are none. */
export class Triangles {
  private static readonly kWeight = 2; // attributes
  private static readonly kFromAxis = 3;
  private readonly vertices: WebGLVertexArrayObject;
  private readonly buffers: WebGLBuffer[];
  private count = 0;
  moves: number | undefined; // as of the mesh whose points these are

  constructor(private readonly gl: WebGL2RenderingContext) {
    this.vertices = gl.createVertexArray()!;
    this.buffers = Array.from({ length: 5 }, () => gl.createBuffer()!);
  }

  fill(points: Float32Array, normals: Float32Array, triangles: Uint32Array, weights?: Float32Array, from_axis?: Float32Array): void {
    const { gl } = this;
    gl.bindVertexArray(this.vertices);
    const give = (attribute: number, values: Float32Array, size: number) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[attribute]!);
      gl.bufferData(gl.ARRAY_BUFFER, values, gl.DYNAMIC_DRAW);
      gl.enableVertexAttribArray(attribute);
      gl.vertexAttribPointer(attribute, size, gl.FLOAT, false, 0, 0);
    };
    give(0, points, 3);
    give(1, normals, 3);
    if (weights) give(Triangles.kWeight, weights, 1);
    if (from_axis) give(Triangles.kFromAxis, from_axis, 3);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.buffers[4]!);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.DYNAMIC_DRAW);
    gl.bindVertexArray(null);
    this.count = triangles.length;
  }

  /** Of the same triangles. */
  move(points: Float32Array, normals: Float32Array): void {
    [points, normals].forEach((values, attribute) => {
      this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this.buffers[attribute]!);
      this.gl.bufferSubData(this.gl.ARRAY_BUFFER, 0, values);
    });
  }

  remove(): void {
    this.gl.deleteVertexArray(this.vertices);
    for (const buffer of this.buffers) this.gl.deleteBuffer(buffer);
  }

  draw(): void {
    this.gl.bindVertexArray(this.vertices);
    this.gl.vertexAttrib1f(Triangles.kWeight, 1);
    this.gl.vertexAttrib3f(Triangles.kFromAxis, 0, 0, 0);
    this.gl.drawElements(this.gl.TRIANGLES, this.count, this.gl.UNSIGNED_INT, 0);
    this.gl.bindVertexArray(null);
  }
}

