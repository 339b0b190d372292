// The task of a page that steers: which, in words, how far it is, and what became of it.
import type { ExerciseHeader, TargetMark, Trainer } from "./data";
import type { ExerciseReport } from "./report";
import { fixed } from "./fixed";
import { hash_with_exercise } from "./address";

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

const kLimits: Record<string, readonly [words: string, unit: string]> = {
  time_s: ["time", "s"], fluoroscopy_s: ["fluoroscopy", "s"], air_kerma_mGy: ["air kerma", "mGy"], dap_Gycm2: ["dose-area product", "Gy cm²"], contrast_ml: ["contrast agent", "ml"], force_N: ["force at the hub", "N"],
  wall_force_N: ["force on the wall", "N"],
};
const digits_of = (limit: number) => (limit < 10 ? 2 : limit < 100 ? 1 : 0);

/** Opens the page anew; another exercise where it takes place. A run that would be lost is asked for. */
function choose(exercise: number, is_another: boolean, has_run: boolean): boolean {
  if (has_run && !confirm("Start again? What was done so far is lost, unless run and report were saved.")) return false;
  history.replaceState(null, "", hash_with_exercise(is_another ? "" : location.hash, exercise));
  location.reload();
  return true;
}

/** Changes what is another item alone: what changes is read out. */
function show_items(list: HTMLElement, items: readonly { words: string; kind: string }[]): void {
  items.forEach(({ words, kind }, i) => {
    const shown = list.children[i] ?? list.appendChild(document.createElement("li"));
    if (shown.textContent !== words) shown.textContent = words;
    if (shown.className !== kind) shown.className = kind;
  });
  while (list.children.length > items.length) list.lastElementChild!.remove();
}

export const words_of_limit = (name: string) => kLimits[name] ?? ([name, ""] as const);

/** What was used of a limit, as far as that is counted. */
export function words_of_use({ name, limit, largest }: ExerciseReport["limits"][number]): string {
  const unit = words_of_limit(name)[1];
  return `${largest === undefined || largest === null ? "at most" : `${fixed(largest, digits_of(limit))} of`} ${limit} ${unit}`;
}

/** What is left of the limits, and where not to go: it changes all the time, and is not read out. */
function show_rules({ limits, forbidden }: ExerciseReport): void {
  show_items(element("exercise-rules"), [
    ...limits.map((limit) => ({ words: `${words_of_limit(limit.name)[0]} ${words_of_use(limit)}`, kind: limit.passed_s === null ? "" : "fault" })),
    ...(forbidden.length === 0 ? [] : [{ words: `keep out of: ${forbidden.join(", ")}`, kind: "" }]),
  ]);
}

/** Of an exercise that is complete. */
const words_of_result = ({ is_passed }: ExerciseReport) => (is_passed ? "Passed." : "Complete, but not passed: see what is marked ✗.");

/** What became of each target, and of forbidden vessels and limits; returns which target is next, -1 for none. */
function show_progress(report: ExerciseReport): number {
  const next = report.targets.findIndex(({ reached_s }) => reached_s === null);
  const item = (words: string, kind: string) => ({ words, kind });
  show_items(element("exercise-progress"), [
    ...report.targets.map(({ name, reached_s }, t) => (reached_s === null ? item(`${t === next ? "▸" : "○"} ${name}`, t === next ? "next" : "") : item(`✓ ${name}: ${fixed(reached_s, 1)} s`, "done"))),
    ...report.forbidden_entries.map(({ name, time_s }) => item(`✗ ${name} entered: ${fixed(time_s, 1)} s`, "fault")),
    ...report.limits.filter(({ passed_s }) => passed_s !== null).map(({ name, limit, passed_s }) => item(`✗ ${words_of_limit(name)[0]} above ${limit} ${words_of_limit(name)[1]}: ${fixed(passed_s!, 1)} s`, "fault")),
  ]);
  show_rules(report);
  const result = element("exercise-result"), words = report.is_complete ? words_of_result(report) : "";
  result.hidden = !report.is_complete;
  if (result.textContent !== words) result.textContent = words;
  return next;
}

/** As a server tells of it. */
export interface ToldExercise extends ExerciseReport {
  title: string;
  task: string;
}

/** The exercise of a live session, which its server has chosen. */
export function show_told(told: ToldExercise): void {
  for (const id of ["exercise-choice", "exercise-again", "exercise-mark"]) element(id).hidden = true;
  element("exercise").hidden = false;
  element("exercise-task").textContent = `${told.title}. ${told.task}`;
  show_progress(told);
}

export class Exercise {
  private readonly exercise: ExerciseHeader | null;
  private shown = "";
  private next: TargetMark | null;
  private is_marked = true;

  /** `has_run`: whether anything was done since the page was opened. */
  constructor({ exercises, exercise }: Trainer, private readonly mark: (target: TargetMark | null) => void, has_run: () => boolean) {
    this.exercise = exercise;
    this.next = exercise?.targets[0] ?? null;
    const choice = element<HTMLSelectElement>("exercise-choice"), number = exercise ? exercises.indexOf(exercise) + 1 : 0;
    choice.append(...exercises.map(({ title }, e) => new Option(`${e + 1}. ${title}`, String(e + 1))), new Option("Steer freely", "0"));
    choice.value = String(number);
    choice.addEventListener("change", () => {
      if (!choose(Number(choice.value), true, has_run())) choice.value = String(number);
    });
    element("exercise-again").addEventListener("click", () => choose(number, false, has_run()));
    element("exercise").hidden = false;
    element("exercise-task").textContent = exercise?.task ?? "";
    const marks = element("exercise-mark");
    marks.hidden = !exercise;
    marks.addEventListener("click", () => {
      this.is_marked = !this.is_marked;
      marks.setAttribute("aria-pressed", String(this.is_marked));
      this.mark(this.is_marked ? this.next : null);
    });
    this.mark(this.next);
  }

  told(report: ExerciseReport | undefined): void {
    const text = JSON.stringify(report);
    if (!report || !this.exercise || text === this.shown) return;
    this.shown = text;
    const next = show_progress(report);
    this.next = next < 0 ? null : this.exercise.targets[next]!;
    if (this.is_marked) this.mark(this.next);
  }
}
