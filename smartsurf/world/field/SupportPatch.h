// Support patches: a patch is the set of cells that a flat face, or a line, of a body lies on, which share
// its load.
//
// The reduced manifold of a flat contact carries the right force and moment at a few points, but a plate
// rests on all the cells that it covers. A patch has one sample per covered cell, a spring of vanishing
// compliance at the centre of the area that the cell shares with the face, or nearer to its lowest corners
// where the face tilts. The load of sample i is N_i = max(0, a + b·x_i + c·y_i), with the force and the
// moment of the normal impulses at the patch's points (least squares among non-negative loads). Each sample
// rubs with its own load; the points have no friction of their own.
//
// If cells have force limits, each cell has contact points of its own, N_i is at most what the cell can give,
// and the points take over these loads.
//
// Elastic tops are springs of finite stiffness: N_i follows from how deep the face is in the top's corners,
// and the points bear nothing (solver/SupportSprings.h). Tops that are too stiff for the step are rigid.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/field/FreeLayoutField.h"

namespace smartsurf::world {

// The samples of several patches as a structure of arrays. Each patch's samples begin at a multiple of kLanes
// and are padded with samples of weight 0. Lengths in world axes, from the body's centre of mass.
struct SupportSamples {
  std::vector<std::int32_t> cell;  // ascending within a patch; −1: padding
  std::vector<float> x, y;         // centre of the area that the cell and the face share
  // Mean distance of that area's points from its centre: the lever of the friction torque.
  std::vector<float> arm;
  std::vector<float> velocity_x, velocity_y, spin;  // of the cell's surface there, u/s, rad/s
  std::vector<float> weight;                        // stiffness: the covered part of the top
  std::vector<float> load;                          // normal impulse over the step, mass·u/s
  // Greatest load of the cell in the substep, mass·u/s; infinite: kUnlimitedLoad. Empty without force limits
  // and elastic tops.
  std::vector<float> limit;
  std::vector<float> separation;  // of the face from the top, u
  // Friction impulse of the last substep along x and y, and its torque about z divided by `arm`; two copies,
  // of which SupportPatch::current is valid.
  std::array<std::array<std::vector<float>, 3>, 2> friction;

  std::size_t size() const { return cell.size(); }
  void resize(std::size_t, bool has_limits);
  void archive(common::StateArchive& a) {
    a(cell, x, y, arm, velocity_x, velocity_y, spin, weight, load, limit, friction);
  }
};
inline constexpr float kUnlimitedLoad = 1e30F;

// The elastic top under a sample. Each corner of the covered part has a quarter of its stiffness and damping.
struct SupportSpring {
  struct Corner {
    float x = 0.0F, y = 0.0F;            // from the body's centre of mass
    float separation = 0.0F;             // of the face from the top, u
    float depth = 0.0F, impulse = 0.0F;  // at the start of the substep, u; over the substep, mass·u/s
  };
  float rise = 0.0F;                       // speed of the top, u/s
  float stiffness = 0.0F, damping = 0.0F;  // of the covered part of the top, mass/s² and mass/s
  std::array<Corner, 4> corner = {};
  std::array<float, 3> step_wrench = {};  // Σ impulse·(1, x, y) over the step
};

// How a patch's point takes part in the load of its cell: by share + share_x·x + share_y·y, if the load acts
// at (x, y) from the cell's sample, u.
struct PointShare {
  std::int32_t sample = -1;  // from the patch's first one; −1: the cell bears nothing
  float share = 0.0F, share_x = 0.0F, share_y = 0.0F;
};

struct SupportPatch {
  std::int32_t body = 0;
  std::int32_t first = 0, count = 0;  // samples, without padding
  // Samples after those, of the cells under points that the face is tilted away from: they have no weight,
  // but a blow may load them.
  std::int32_t outlier_count = 0;
  std::int32_t first_point = 0, point_count = 0;  // in SupportPatches::points
  float z = 0.0F;                                 // of the samples, from the centre of mass
  bool moves = false;                             // whether any of its cells moves or has a surface velocity
  // True if all its cells have one surface velocity, that of the belt, which may be 0, and do not turn or
  // rise.
  bool is_one_belt = false;
  bool turns = false;                  // whether any of its cells has a surface that turns
  float belt_x = 0.0F, belt_y = 0.0F;  // u/s
  bool has_friction = false;           // whether the friction impulses of the last step were found
  bool has_shares = false;             // whether its points are in SupportPatches::shares
  bool is_elastic = false;             // whether its cells have elastic tops
  // True if `friction_sum` alone is valid, not the friction of the samples: the cells are one belt, on which
  // none of them slips.
  bool is_lumped = false;
  bool may_lump() const { return is_one_belt && !has_shares && !is_elastic; }
  int current = 0;  // the valid copy of SupportSamples::friction

  // ---- of the solver
  std::int32_t row = 0, batch_point = 0, lane = 0;
  bool has_impulse_limit = false;                      // of its contact batch
  bool is_lightly_loaded = true;                       // no cell had a load near its limit in the last step
  float friction = 0.0F;                               // coefficient
  double total_weight = 0.0;                           // of the samples
  double centre_x = 0.0, centre_y = 0.0, scale = 1.0;  // weighted mean and extent of the samples
  // Greatest distance of a sample's area from the mean, least arm, u, and mean square of the areas'
  // distances, u².
  double reach = 0.0, min_arm = 0.0, gyration_squared = 0.0;
  double load[3] = {};  // a, b, c of the load in the coordinates (x − centre_x) / scale, per `force`
  double force = 0.0;   // sum of the normal impulses for which `load` holds
  double load_sums[3] = {},
         load_stiffness[6] = {};  // of `load`, in its coordinates; stiffness as a symmetric matrix
  // Offset from the centre of the loads to that of the normal impulses. It is not 0 where the samples cannot
  // balance the moment, for example if the body overhangs them.
  double offset_x = 0.0, offset_y = 0.0;
  double centre_of_force[2] = {};  // of these normal impulses, in the coordinates of `load`
  double response[6] = {}, inverse_response[6] = {};  // see SupportSolver
  double tangent_mass = 0.0;                          // of one sample
  double friction_sum[3] = {};                        // applied: force along x and y, torque about z
  // Elastic patches only: the sum of the applied loads and their moments Σ N·(1, x, y); the velocity of the
  // face at (x, y) as a + b·x + c·y, at the start of the step, the end of the last substep and of the solve
  // stage.
  double spring_wrench[3] = {}, start_motion[3] = {}, last_motion[3] = {}, solve_motion[3] = {};
  double implicit_share = 0.0;  // w in solver/SupportSprings.h
};

struct SupportPatches {
  std::vector<SupportPatch> patches;
  std::vector<std::int32_t> points;  // contacts of the patches, as indices in their body's manifold
  std::vector<PointShare> shares;    // one per point; empty without force limits
  SupportSamples samples;
  std::vector<SupportSpring> springs;  // one per sample; empty without elastic tops
  void clear();
  void archive(common::StateArchive& a) { a(patches, points, shares, samples); }
};

// Adds the patch of a body if its flat underside lies on at least two cells. `free_layout`: null for a
// rectangular field. `contacts`: of the body with the field. Elastic tops that under the face are together
// stiffer than `max_stiffness`, mass/s², are rigid ones. Returns whether a patch was added.
bool add_support_patch(const surface::Field&, const FreeLayoutField* free_layout, const BodyStore&,
                       std::int32_t body, float margin, float max_stiffness,
                       std::span<const Contact> contacts, SupportPatches& out);

// Removes the last patch's points on cells that the face does not cover but only touches at its rim, because
// such cells bear nothing. Calls remove(k) for each; k is the contact's index in the list without those
// removed before.
template <class Remove>
void remove_points_without_share(SupportPatches& list, Remove remove) {
  SupportPatch& patch = list.patches.back();
  for (Index i = patch.first_point; i < std::ssize(list.points);) {
    if (list.shares[i].sample >= 0) {
      ++i;
      continue;
    }
    const std::int32_t contact = list.points[i];
    remove(contact);
    list.points.erase(list.points.begin() + i);
    list.shares.erase(list.shares.begin() + i);
    for (Index k = patch.first_point; k < std::ssize(list.points); ++k)
      if (list.points[k] > contact) --list.points[k];
    --patch.point_count;
  }
}

// Takes over the friction impulses of the same cells from a patch of the previous step.
void match_support_patch(const SupportPatches& previous, const SupportPatch& from, SupportPatches& current,
                         SupportPatch& to);

// Appends a copy of another list's patch, without its points and outliers.
void append_patch(const SupportPatches& from, const SupportPatch&, SupportPatches& to);

// Prepares the patches for the removal of `body`, as remove_body(ContactList&).
void remove_body(SupportPatches&, std::int32_t body);

}  // namespace smartsurf::world
