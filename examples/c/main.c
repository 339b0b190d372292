/* Pushes a wire and a catheter over it up an artery that forks, and prints what the hand feels. Where a
 * motion.json is named, the body moves about them, and holds its breath half way. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <xraycast/c/simulation.h>

static void check(xrc_status status) {
  if (status == XRC_OK) return;
  fprintf(stderr, "%s\n", xrc_last_error());
  exit(status);
}

static int has_mode(const xrc_simulation* simulation, const char* wanted) {
  const char* name;
  for (size_t m = 0; xrc_get_mode(simulation, m, &name) == XRC_OK; ++m)
    if (strcmp(name, wanted) == 0) return 1;
  return 0;
}

int main(int argc, char** argv) {
  /* x, y, z and radius in mm: z grows towards the head, x to the patient's left. */
  static const double trunk[] = {0, 0, 0, 4, 0, 0, 60, 5, 0, 0, 120, 6};
  static const double left[] = {0, 0, 120, 6, 8, 0, 150, 5, 12, 0, 220, 5};
  static const double right[] = {0, 0, 120, 6, -25, 0, 145, 3, -50, 0, 165, 3};
  const xrc_branch branches[] = {{trunk, 3, -1}, {left, 3, 0}, {right, 3, 0}};
  const char* const instruments[] = {"cobra-5f", "guidewire-035-j"}; /* the outermost first */
  const xrc_setup setup = {
      .branches = branches, .branch_count = 3, .instruments = instruments, .instrument_count = 2};

  const xrc_body body = {.motion_file = argc > 1 ? argv[1] : NULL};

  xrc_simulation* simulation;
  check(argc > 1 ? xrc_create_moving(&setup, &body, &simulation) : xrc_create(&setup, &simulation));
  xrc_hub hubs[2] = {{0, 0}, {0, 0}};
  for (int step = 0; step < 2000; ++step) { /* of a millisecond */
    hubs[0].insertion_mm += 0.05;           /* the catheter at 50 mm/s, the wire at 80 mm/s */
    hubs[1].insertion_mm += 0.08;
    if (step == 1000 && has_mode(simulation, "breath")) check(xrc_hold(simulation, "breath"));
    check(xrc_step(simulation, hubs, 2));
  }

  for (size_t i = 0; i < 2; ++i) {
    xrc_load load;
    xrc_tip tip;
    xrc_contact contacts[16];
    size_t count;
    check(xrc_get_load(simulation, i, &load));
    check(xrc_get_tip(simulation, i, &tip));
    check(xrc_get_contacts(simulation, i, contacts, 16, &count));
    printf("%s: tip at %.1f %.1f %.1f mm in branch %d, %zu contacts, the hub feels %.3f N\n", instruments[i],
           tip.position_mm[0], tip.position_mm[1], tip.position_mm[2], tip.branch, count, load.force_N);
  }
  xrc_destroy(simulation);
  return 0;
}
