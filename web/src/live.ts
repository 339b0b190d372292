// A live session: the picture follows the server, and the controls on the page steer.
import { BodyChange, BodyControls } from "./live_body";
import { Connection, Role, SessionLink } from "./connection";
import { MovingDrums, filled } from "./contrast";
import type { Live, Motion, Trainer } from "./data";
import { Exchange, ExchangeOrder } from "./exchange";
import { device_surfaces } from "./device_shape";
import { surfaces_of } from "./instrument_shape";
import { fixed } from "./fixed";
import { LiveMessage, message_of } from "./live_message";
import { ModeHeader, MotionMode } from "./motion_mode";
import type { Notes } from "./notes";
import { Exercise, show_told } from "./exercise";
import { ExposurePanel } from "./exposure_panel";
import type { ConsoleSettings, MaskMatching } from "./fluoroscope";
import { Fluoroscopy } from "./fluoroscopy";
import { Recording } from "./recording";
import { Report } from "./report";
import { name_of_file, save_file } from "./saved_file";
import type { Picture } from "./picture";
import type { Store } from "./state";
import { SteeringAction, Steering } from "./steering";
import { Loads, LoadChart } from "./load_chart";
import type { PressureReading } from "./live_message";
import { PressureChart, Pressures } from "./pressure_chart";
import { TableFollow, followed_mm } from "./table_follow";
import { Treating, state_of } from "./treating";
import { TrainerLink, TrainerWorker } from "./trainer";

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

const kAlive_ms = 250; // between messages of the page that steers, also while nothing changes
const kReadout_ms = 200;
const kKept_s = 10; // of loads
const kSamples = 240; // that charts have of them

const kNoPressure: PressureReading = { now_mmHg: 0, systolic_mmHg: 0, diastolic_mmHg: 0, mean_mmHg: 0 };

/** The loads of the last seconds, of each hub, and the pressures of the blood. */
export class LastLoads {
  private readonly times_s: number[] = [];
  private readonly aortic_mmHg: number[] = [];
  private readonly loads: { force_N: number[]; torque_mNm: number[]; tip_mmHg: number[]; reading: PressureReading }[];
  constructor(private readonly names: readonly string[]) {
    this.loads = names.map(() => ({ force_N: [], torque_mNm: [], tip_mmHg: [], reading: kNoPressure }));
  }

  add({ time_s, instruments, aortic_mmHg }: Pick<LiveMessage, "time_s" | "instruments" | "aortic_mmHg">): void {
    const last_s = this.times_s[this.times_s.length - 1] ?? -Infinity;
    if (time_s < last_s) this.clear(); // another run
    if (time_s === last_s) return;
    this.times_s.push(time_s);
    this.aortic_mmHg.push(aortic_mmHg);
    this.loads.forEach((of_hub, d) => {
      of_hub.force_N.push(instruments[d]?.force_N ?? 0);
      of_hub.torque_mNm.push(instruments[d]?.torque_mNm ?? 0);
      of_hub.reading = instruments[d]?.pressure ?? kNoPressure;
      of_hub.tip_mmHg.push(of_hub.reading.now_mmHg);
    });
    while (this.times_s[0]! < time_s - kKept_s) this.drop_first();
  }

  of(hub: number): Loads {
    const { times_s } = this, last = times_s.length - 1, force_N = this.even(this.loads[hub]!.force_N), torque_mNm = this.even(this.loads[hub]!.torque_mNm);
    return { instrument: this.names[hub]!, force_N, torque_mNm, now: force_N.length - 1, length_s: last > 0 ? times_s[last]! - times_s[0]! : 0 };
  }

  pressures(hub: number): Pressures {
    const { tip_mmHg, reading } = this.loads[hub]!;
    return { instrument: this.names[hub]!, aortic_mmHg: this.even(this.aortic_mmHg), tip_mmHg: this.even(tip_mmHg), reading };
  }

  /** At even times, whenever messages came. */
  private even(values: readonly number[]): number[] {
    const { times_s } = this, last = times_s.length - 1;
    if (last < 1) return [...values];
    let next = 0;
    return Array.from({ length: kSamples }, (_, i) => {
      const time_s = times_s[0]! + ((times_s[last]! - times_s[0]!) * i) / (kSamples - 1);
      while (next < last && times_s[next]! < time_s) ++next;
      return values[next]!;
    });
  }

  private drop_first(): void {
    for (const values of [this.times_s, this.aortic_mmHg, ...this.loads.flatMap(({ force_N, torque_mNm, tip_mmHg }) => [force_N, torque_mNm, tip_mmHg])]) values.shift();
  }

  private clear(): void {
    while (this.times_s.length > 0) this.drop_first();
  }
}

/** Where the page's server tells of the session. */
const socket_address = ({ origin, search }: Location) => `${origin.replace(/^http/, "ws")}/live${search}`;

/** By the heart, or else by the first mode. */
function matching_of(modes: readonly ModeHeader[]): MaskMatching | null {
  const mode = Math.max(0, modes.findIndex(({ name }) => name === "heart")), header = modes[mode];
  return header ? { mode, wraps: header.wraps, cycle_s: new MotionMode(header).cycle_s } : null;
}

/** What was subtracted or mapped would be lost with the view: then the table stays where it is. */
const keeps_table = ({ subtracts, shows_road_map }: Pick<ConsoleSettings, "subtracts" | "shows_road_map">) => subtracts || shows_road_map;

export class LiveView {
  private readonly chart: LoadChart;
  private readonly pressure: PressureChart;
  private readonly particles = element<HTMLSelectElement>("particles");
  private readonly body: BodyControls | null;
  private readonly loads: LastLoads;
  private readonly recording: Recording;
  private readonly steering: Steering;
  private readonly exchange: Exchange | null;
  private readonly treating: Treating | null;
  private exposure: ExposurePanel | null = null;
  private readonly drums: MovingDrums | null; // of a body in motion whose server does not tell how they move
  private readonly connection: SessionLink | null;
  private newest: LiveMessage | null = null;
  private exposed_s = -Infinity; // when the pedal was down last
  private exposures = -1; // of the picture that is shown
  private has_moved = false; // the C-arm, by this page, since the server was told
  private held_hub = -1;
  private has_told_of_lumen = false; // since the injector was pressed
  private shown_ms = -Infinity;
  private is_due = false;
  private follows = true;
  private readonly table_follow = new TableFollow();
  private is_new_here = false; // whoever steers, and is told how

  constructor(private readonly live: Live, private readonly trainer: Trainer | null, worker: TrainerWorker | null, motion: Motion | null, private readonly store: Store, private readonly picture: Picture, private readonly notes: Notes,
    private readonly stage: HTMLElement, private readonly redraw: () => void) {
    const names = live.instruments.map(({ name }) => name);
    document.body.classList.add("live");
    for (const id of ["hand", "live", "live-keys", "save-run"]) element(id).hidden = false;
    element("save-run").addEventListener("click", () => save_file(new Blob([this.recording.csv()], { type: "text/csv" }), name_of_file("run", trainer?.exercise?.title ?? "", "csv")));
    this.show_keys(false);
    this.recording = new Recording(names.length);
    this.loads = new LastLoads(names);
    this.chart = new LoadChart(names, (hub) => this.loads.of(hub));
    this.pressure = new PressureChart(() => this.loads.pressures(this.chart.hub));
    this.drums = trainer && motion?.lattice ? new MovingDrums(live.contrast, motion.lattice) : null;
    this.body = live.modes?.length ? new BodyControls(live.modes, (body) => this.send({ body })) : null;
    if (this.body) addEventListener("keydown", (event) => this.press(event, this.body!), { capture: true });
    this.steering = new Steering(stage, live.has_hub, live.has_hub && names.length > 1, () => this.send(), (action) => this.send({ [action]: true }));
    this.exchange = trainer && trainer.choices.length > names.length ? new Exchange(trainer, (exchange) => this.send({ exchange })) : null;
    this.treating = live.has_hub ? new Treating((order) => this.send(order)) : null;
    this.particles.addEventListener("change", () => {
      this.mix_in();
      this.particles.blur(); // arrows steer again
    });
    this.connection = trainer && worker ? this.simulate(trainer, worker, names, motion) : location.protocol.startsWith("http") ? this.connect() : null;
    if (!this.connection) notes.state("This page belongs to a live session: open the address that xraycast printed.");
    store.on_change((state, before) => state.pose !== before.pose && this.steering.steers && this.tell_c_arm());
    setInterval(() => this.steering.steers && this.send(), kAlive_ms);
  }

  private connect(): Connection {
    this.notes.state("Connecting …");
    return new Connection(socket_address(location), {
      told: (message) => this.told(message), has_role: (role) => this.has_role(role), lost: () => this.lost(),
    });
  }

  private simulate(trainer: Trainer, worker: TrainerWorker, names: string[], motion: Motion | null): SessionLink {
    const report = new Report((shows_series) => this.send({ shows_series }), () => this.send({ save_report: true }));
    const exercise = trainer.exercises.length === 0 ? null : new Exercise(trainer, (target) => {
      this.picture.target = target;
      this.redraw();
    }, () => report.has_run);
    const exposure = (this.exposure = this.add_exposure(trainer, motion && matching_of(motion.modes)));
    const link = new TrainerLink(trainer, worker, {
      compiled: (code, setup) => this.begin_fluoroscopy(code, setup, exposure, link),
      moved: (steps) => this.recording.add_steps(steps),
      reported: (told) => {
        report.told(told);
        exercise?.told(told.exercise);
      },
      saves: (told) => save_file(new Blob([`${JSON.stringify(told)}\n`], { type: "application/json" }), name_of_file("report", trainer.exercise?.title ?? "", "json")),
      told: (message) => this.told(message), has_role: (role) => this.has_role(role), refused: (why) => this.notes.tell(`${why}.`),
      exchanged: (instrument, choice) => {
        this.live.instruments[instrument] = trainer.choices[choice]!;
        names[instrument] = trainer.choices[choice]!.name;
        this.recording.clear();
        this.newest = null; // which tells of the instrument before
        this.treating?.forget();
        this.exchange!.took(instrument, choice);
        this.chart.rename(instrument, names[instrument]!);
      },
      failed: (why) => {
        this.steering.steers = false;
        this.notes.state(`The simulation has ended: ${why}.`);
      },
    });
    return link;
  }

  /** The page's own fluoroscope has controls from the start, and makes pictures once its code is there. */
  private add_exposure({ dose, compression }: Trainer, matching: MaskMatching | null): ExposurePanel {
    const panel = new ExposurePanel({
      set: (settings) => {
        if (this.picture.fluoroscopy) this.picture.fluoroscopy.settings = settings;
        element<HTMLButtonElement>("table-follows").disabled = keeps_table(settings);
        this.redraw(); // where the blades are
      },
      take_new_mask: () => this.picture.fluoroscopy?.take_new_mask(),
      field_mm: () => this.picture.field_mm(this.store.state),
    }, { dose, compression }, matching);
    this.store.on_change((state, before) => state.pose !== before.pose && panel.show_settings());
    addEventListener("keydown", (event) => this.press(event, panel), { capture: true });
    const table_follows = element("table-follows"), following = { takes: (key: string) => key === "t" && (this.switch_following(), true) };
    table_follows.hidden = false;
    table_follows.addEventListener("click", () => this.switch_following());
    addEventListener("keydown", (event) => this.press(event, following), { capture: true });
    return panel;
  }

  private begin_fluoroscopy(code: WebAssembly.Module, setup: Float64Array, panel: ExposurePanel, link: TrainerLink): void {
    const fluoroscopy = new Fluoroscopy(code, setup, {
      shows: (_, exposed) => {
        panel.show(exposed);
        link.count_dose(exposed);
        this.redraw();
      },
      is_ready: () => fluoroscopy.is_due && this.redraw(),
      failed: (why) => this.notes.tell(`${why}.`),
    });
    fluoroscopy.settings = panel.settings;
    this.picture.fluoroscopy = fluoroscopy;
  }

  private told(bytes: ArrayBuffer): void {
    try {
      this.newest = message_of(bytes);
    } catch (error) {
      return this.notes.state((error as Error).message);
    }
    if (this.newest.exposes && this.is_new_here) {
      this.is_new_here = false;
      this.notes.state("");
    }
    this.loads.add(this.newest);
    if (!this.trainer) this.recording.add(this.newest);
    if (this.newest.body) this.body?.told(this.newest.body);
    if (this.is_due) return;
    this.is_due = true; // messages that come while a picture is drawn are passed over
    requestAnimationFrame(() => {
      this.is_due = false;
      if (this.newest) this.show(this.newest);
    });
  }

  private show(message: LiveMessage): void {
    const is_new = message.exposures !== this.exposures;
    this.expose(message);
    const has_image = !this.trainer || message.exposures > 1; // by the pedal, that can be held
    if (message.exposes || !has_image) this.picture.held_pose = null;
    else if (is_new || !this.picture.held_pose) this.hold();
    if (is_new) {
      if (message.exposes) this.follow(message);
      this.exposures = message.exposures;
      const instruments = this.live.instruments.flatMap((instrument, d) => surfaces_of(instrument, message.instruments[d]?.parts_mm ?? []));
      const phases = message.body?.modes.map(({ phase }) => phase);
      const contrast = filled(this.live.contrast, this.drums && phases ? this.drums.moved(message.filled, phases) : message.filled);
      const seen = [...instruments, ...device_surfaces(message.devices, this.live.matters)];
      this.picture.live = contrast ? [...seen, contrast] : seen;
      this.move_body(message);
      this.redraw();
    }
    document.documentElement.dataset.exposures = String(message.exposures);
    this.chart.draw();
    this.pressure.draw();
    this.body?.draw();
    const now_ms = performance.now();
    if (now_ms - this.shown_ms < kReadout_ms) return;
    this.shown_ms = now_ms;
    this.read_out(message);
  }

  /** The pulses that the message tells of. The first exposure of all is no pulse. */
  private expose({ exposes, exposures, time_s }: LiveMessage): void {
    const { fluoroscopy } = this.picture, kMessage_s = 0.1;
    if (!exposes || !fluoroscopy) return;
    if (time_s - this.exposed_s > kMessage_s) fluoroscopy.begin_run(Math.min(3600, time_s - this.exposed_s));
    this.exposed_s = time_s;
    if (this.exposures >= 0) fluoroscopy.expose(exposures - this.exposures);
  }

  private follow(message: LiveMessage): void {
    const { store, picture } = this, { pose } = store.state, settings = this.exposure?.settings;
    if (!this.follows || !settings || keeps_table(settings)) return;
    const tip_mm = this.table_follow.moved_tip_mm(message), view = picture.view(store.state);
    if (tip_mm === null) return;
    const table_mm = followed_mm(pose.table_mm, picture.bounds.centre_mm[2], view, tip_mm);
    if (table_mm !== pose.table_mm) store.update({ pose: { ...pose, table_mm } });
  }

  private switch_following(): void {
    this.follows = !this.follows;
    element("table-follows").setAttribute("aria-pressed", String(this.follows));
  }

  /** The picture's body, where the page has the maps of a body that moves. */
  private move_body({ body }: LiveMessage): void {
    if (!body) return;
    if (this.picture.fluoroscopy) this.picture.fluoroscopy.motion_speed = body.speed;
    const phases = body.modes.map(({ phase }) => phase);
    this.store.update({ phases, is_paused: false });
    document.documentElement.dataset.phases = phases.map((phase) => phase.toFixed(4)).join();
  }

  /** Without the pedal the picture stays as the C-arm stood at the last exposure. */
  private hold(): void {
    this.picture.held_pose = this.store.state.pose;
    this.redraw();
  }

  private read_out(message: LiveMessage): void {
    const { held_hub, instruments, exposes, injects } = message, held = instruments[held_hub];
    if (this.live.has_hub && held_hub !== this.held_hub) {
      this.chart.choose(held_hub);
      if (this.held_hub >= 0) this.notes.tell(`You hold the ${this.live.instruments[held_hub]?.name ?? "other"}.`);
    }
    if (injects && !message.has_outlet && !this.has_told_of_lumen) this.notes.tell("No lumen is free: draw the wire back to 0 mm to inject.");
    this.has_told_of_lumen = injects;
    this.held_hub = held_hub;
    this.chart.show();
    this.pressure.show();
    this.exchange?.show(held_hub);
    const header = this.live.instruments[held_hub];
    if (held && header) this.treating?.show(held_hub, header, held);
    const treating = held && header ? state_of(header, held, message.packing) : null;
    element("live-readout").textContent = [
      `${this.live.instruments[held_hub]?.name ?? ""} ${fixed(held?.insertion_mm ?? 0, 0)} mm, ${fixed(held?.rotation_deg ?? 0, 0)}°`,
      ...(held && held.insertion_mm > 0 ? [`tip in ${this.live.vessels[held.tip_branch] ?? "a vessel"}`] : []),
      ...(treating ? [treating] : []),
      `${exposes ? "fluoroscopy" : "held picture"} ${message.fluoroscopy_s.toFixed(0)} s`, `${!injects ? "" : message.has_outlet ? "injecting, " : "no lumen is free, draw the wire back to 0 mm to inject; "}${message.injected_ml.toFixed(0)} ml`,
      ...(this.body?.state ? [this.body.state] : []),
    ].join("  ·  ");
    this.body?.show();
    element("inject").setAttribute("aria-pressed", String(injects));
    element("pedal").classList.toggle("on", exposes); // by whatever pedal
    element("valve").setAttribute("aria-pressed", String(message.is_valve_locked));
  }

  private has_role({ steers, browsers, exercise }: Role): void {
    if (exercise) show_told(exercise);
    this.notes.state("");
    this.treating?.forget();
    this.steering.steers = steers;
    this.show_keys(steers);
    const others = browsers > 1 ? `; ${browsers} browsers are connected` : "";
    element("live-role").textContent = (steers ? this.live.has_hub ? "You steer" : "You have pedal and injector" : "You watch; another browser steers") + others;
    for (const button of document.querySelectorAll<HTMLButtonElement | HTMLSelectElement | HTMLInputElement>("#hand button, #live button, #live select, #treating input")) button.disabled = !steers;
    if (steers) this.exposure?.show_settings();
    if (steers) this.mix_in(); // what another browser chose is not told
    if (this.trainer) {
      this.is_new_here = true;
      this.notes.state(matchMedia("(pointer: coarse)").matches ? "Tap Fluoroscopy to see, and hold Push to advance." : "Hold X to see, ↑ to advance and I to inject; the other keys are under Help.");
    }
    if (steers && document.activeElement === document.body) this.stage.focus({ preventScroll: true }); // Tab holds the next instrument
    this.send();
  }

  /** Under Help. */
  private show_keys(steers: boolean): void {
    const moves_hub = steers && this.live.has_hub, has_valve = moves_hub && this.live.instruments.length > 1;
    const applies: Record<string, boolean> = { steers, body: steers && this.body !== null, exposure: steers && this.exposure !== null, hub: moves_hub, valve: has_valve, arrows: !moves_hub, inverted: !steers, vessels: !has_valve, run: false };
    for (const row of document.querySelectorAll<HTMLElement>("[data-keys]")) row.hidden = !applies[row.dataset.keys!];
  }

  private lost(): void {
    if (!this.picture.held_pose) this.hold();
    this.steering.steers = false;
    this.steering.let_go();
    element("live-role").textContent = "Not connected";
    this.notes.state("Connection lost; trying again … A server that is started anew prints another address.");
  }

  private tell_c_arm(): void {
    this.has_moved = true;
    this.send();
  }

  private press(event: KeyboardEvent, controls: { takes(key: string): boolean }): void {
    if (!this.steering.steers || event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
    if ((event.target as HTMLElement).matches("input, select") || !controls.takes(event.key.toLowerCase())) return;
    event.preventDefault();
    event.stopImmediatePropagation();
  }

  /** What the page shows is in the agent. */
  private mix_in(): void {
    this.send({ particles: { mm: Number(this.particles.value) } });
  }

  private send(once: { [action in SteeringAction]?: boolean } & Partial<Record<"balloon" | "sheath" | "detach" | "particles", object>> & { body?: BodyChange; exchange?: ExchangeOrder; shows_series?: boolean; save_report?: boolean } = {}): void {
    if (!this.steering.steers || !this.connection) return;
    const { pose } = this.store.state, message: Record<string, unknown> = { ...this.steering.held, ...once };
    if (this.has_moved && !this.trainer) message.c_arm = { lao_deg: pose.lao_deg, cranial_deg: pose.cranial_deg, zoom: pose.zoom, table_mm: pose.table_mm };
    this.has_moved = false;
    this.connection.send(message);
  }
}
