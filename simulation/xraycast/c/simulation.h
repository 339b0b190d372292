/* The simulation of catheters and guide wires for programs in C, and for engines that load a shared library.
 *
 * Positions are in patient coordinates (LPS) and millimetres, forces in newtons, angles in radians. Functions
 * return XRC_OK or an error, whose text xrc_last_error() has; a call that fails changes nothing and fills in
 * nothing. Simulations are independent of each other; one simulation is for one thread at a time. */
#ifndef XRAYCAST_C_SIMULATION_H
#define XRAYCAST_C_SIMULATION_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The values are the program's exit statuses. */
typedef enum xrc_status {
  XRC_OK = 0,
  XRC_ERROR = 1,      /* neither: memory is short, for instance */
  XRC_INPUT_ERROR = 3 /* an argument or a file cannot be used */
} xrc_status;

/* One line about the last call of this thread that failed, valid until its next one that does; "" before. */
const char* xrc_last_error(void);

/* Instruments in a vessel tree, one inside the other. */
typedef struct xrc_simulation xrc_simulation;

/* A vessel between two bifurcations or ends, from its parent's side onwards. */
typedef struct xrc_branch {
  const double* points; /* point_count times x, y, z, radius in mm; two or more points */
  size_t point_count;
  int parent; /* the index of the branch whose last point is this one's first; -1 for the root */
} xrc_branch;

/* What is simulated: a tree and instruments; what else is 0 has a default. */
typedef struct xrc_setup {
  const char* tree_file; /* .vtp or .json, or the folder that `segment` wrote; NULL: the branches below */
  const xrc_branch* branches; /* copied */
  size_t branch_count;
  const char* const* instruments; /* names of presets or JSON files, the outermost first */
  size_t instrument_count;        /* 1 to 3 */
  const double* entry_mm; /* a point near a vessel's end; NULL: the most inferior end that is wide enough */
  double step_s;          /* 0: a millisecond */
} xrc_setup;

/* A mode of a motion that is held at a phase, 0 to 1. */
typedef struct xrc_held_mode {
  const char* mode;
  double phase;
} xrc_held_mode;

/* How the body moves about the instruments; what else is 0 has a default. */
typedef struct xrc_body {
  const char* motion_file;   /* motion.json, as `xraycast motion` writes it; the tree is that of its scan */
  double start_s;            /* the motion's time as the instruments are put in */
  const xrc_held_mode* held; /* modes that are held from then on; the others go on */
  size_t held_count;
  double speed; /* of the others: 2 breathes and beats twice as fast; 0: 1 */
} xrc_body;

/* The position of a hub, an instrument's outer end, which the hand holds. */
typedef struct xrc_hub {
  double insertion_mm; /* positive into the body; at 0 the tip is at the vessel's end */
  double rotation_rad; /* about the direction of insertion, right-handed; adds up over whole turns */
} xrc_hub;

/* On the hand. */
typedef struct xrc_load {
  double force_N;   /* positive pushes the hand back, out of the body */
  double torque_Nm; /* positive resists a positive rotation */
} xrc_load;

typedef struct xrc_tip {
  double position_mm[3];
  double direction[3]; /* unit */
  int branch;
  double arc_length_mm; /* from the branch's first point */
} xrc_tip;

/* Where an instrument touches a vessel's wall, and the wall's force on it, friction included. */
typedef struct xrc_contact {
  double position_mm[3];
  double force_N[3];
} xrc_contact;

/* Makes a simulation at an insertion of 0, which xrc_destroy() ends. Takes some 50 ms. */
xrc_status xrc_create(const xrc_setup* setup, xrc_simulation** simulation);
/* The same in a body that moves as time passes; the instruments lie in the body as it is, the tree in the
 * scan. */
xrc_status xrc_create_moving(const xrc_setup* setup, const xrc_body* body, xrc_simulation** simulation);
void xrc_destroy(xrc_simulation* simulation); /* of NULL: nothing */

/* One step in time towards a pose for each instrument, the outermost first: `hub_count` is how many there
 * are. A hub moves by at most 300 mm/s and 30 rad/s, and does not advance against more than 3 N. Call it at a
 * steady rate of one in `step_s`; a step takes a fraction of a millisecond. Reads no file and takes no lock.
 */
xrc_status xrc_step(xrc_simulation* simulation, const xrc_hub* hubs, size_t hub_count);

/* The same while the body moves to these phases, 0 to 1, one a mode in the motion's order, for a program with
 * a clock of its own; the simulation's stands still. */
xrc_status xrc_step_at(xrc_simulation* simulation, const xrc_hub* hubs, size_t hub_count,
                       const double* phases, size_t phase_count);

/* Holds a mode where it is, as a patient's breath, or lets it go on from there. */
xrc_status xrc_hold(xrc_simulation* simulation, const char* mode);
xrc_status xrc_release(xrc_simulation* simulation, const char* mode);

/* The phases of the motion's modes as of the last step, in order. Writes at most `capacity`, and how many
 * there are into `count`: 0 in a body that is still. */
xrc_status xrc_get_phases(const xrc_simulation* simulation, double* phases, size_t capacity, size_t* count);

/* The name of a mode, counted from 0, valid until xrc_destroy(). */
xrc_status xrc_get_mode(const xrc_simulation* simulation, size_t mode, const char** name);

/* What a tip's place shows: its position, but in a body that moves the scan's, where the tree lies. */
xrc_status xrc_get_tip_in_scan(const xrc_simulation* simulation, size_t instrument, double position_mm[3]);

xrc_status xrc_get_hub(const xrc_simulation* simulation, size_t instrument, xrc_hub* hub);
xrc_status xrc_get_load(const xrc_simulation* simulation, size_t instrument, xrc_load* load);
xrc_status xrc_get_tip(const xrc_simulation* simulation, size_t instrument, xrc_tip* tip);

/* The nodes from the outer end of the introducer, 20 mm outside the vessel, to the tip: x, y, z in mm each.
 * Writes at most `capacity` nodes, and how many there are into `count`, which changes as the instrument
 * advances. */
xrc_status xrc_get_shape(const xrc_simulation* simulation, size_t instrument, double* nodes_mm,
                         size_t capacity, size_t* count);

/* Writes at most `capacity` contacts, and how many there are into `count`. */
xrc_status xrc_get_contacts(const xrc_simulation* simulation, size_t instrument, xrc_contact* contacts,
                            size_t capacity, size_t* count);

/* Another instrument, a preset or a JSON file, instead of one that has been drawn back to 0. The others do
 * not move. Takes some 50 ms. */
xrc_status xrc_exchange(xrc_simulation* simulation, size_t instrument, const char* name_or_file);

/* To which pressure the balloon of an instrument is filled by the steps from now on, at 10 bar/s and no
 * further than it bears, and only while all of it is beyond the introducer and the instruments around it; 0
 * folds it. An instrument without a balloon stays as it is. */
xrc_status xrc_inflate(xrc_simulation* simulation, size_t instrument, double bar);

/* How far the sheath of an instrument's stent, which opens itself, is drawn back by the steps from now on, at
 * 50 mm/s. It never goes back over the stent. */
xrc_status xrc_draw_sheath(xrc_simulation* simulation, size_t instrument, double mm);

/* Detaches the coil on an instrument's wire in the next step, where all of it lies in an aneurysm, else not
 * at all. An instrument without coils is an error. */
xrc_status xrc_detach(xrc_simulation* simulation, size_t instrument);

/* The coil on a wire, as of the last step. An instrument without coils is an error. */
typedef struct xrc_coil {
  double loop_mm;      /* the diameter of its loops */
  double length_mm;    /* 0: there is none; the next one comes as the wire is drawn back to 0 */
  double laid_mm;      /* of it, in an aneurysm */
  int is_outside;      /* its end is out, but in no aneurysm */
  int can_be_detached; /* all of it lies in an aneurysm */
  int detached;        /* coils of this wire so far */
  double packing;      /* density, 0 to 1, of the aneurysm in which its last coil lies */
} xrc_coil;
xrc_status xrc_get_coil(const xrc_simulation* simulation, size_t instrument, xrc_coil* coil);

/* What an instrument treats with, as of the last step. */
typedef struct xrc_device {
  double balloon_bar;
  double balloon_mm; /* its diameter; 0 without a balloon */
  double sheath_mm;  /* drawn back so far */
  int carried_rings; /* of its stent, that are still on the balloon or in the sheath */
} xrc_device;
xrc_status xrc_get_device(const xrc_simulation* simulation, size_t instrument, xrc_device* device);

/* What a balloon or a stent did to a vessel. Diameters are of the lumen, lengths along the branch from its
 * first point. */
typedef struct xrc_treatment {
  size_t instrument;
  int is_over; /* the balloon is folded again, all of the stent is free, or it is out */
  int branch;
  double from_mm, to_mm;
  double largest_bar;
  double opened_mm; /* the balloon's diameter at that pressure, or the stent's */
  double least_before_mm, least_after_mm;
  double reference_mm; /* the vessel's, beside that length, before */
  double occluded_s;   /* for so long it filled its vessel */
  double stent_mm;     /* the diameter of the stent that was left there; 0 without one, and until a balloon is
                          folded */
} xrc_treatment;

/* Writes at most `capacity` treatments, in order, and how many there are into `count`. */
xrc_status xrc_get_treatments(const xrc_simulation* simulation, xrc_treatment* treatments, size_t capacity,
                              size_t* count);

#ifdef __cplusplus
}
#endif
#endif
