// A direct solver for islands in which light bodies bear heavy loads.
//
// Sequential impulses carry a load through a light body in about as many sweeps as the load is heavier than
// the body, and the springs of its contacts are as soft as the body is light: a tonne sinks into a table on
// four legs of a kilogram. In such islands the normal impulses are solved at once after each sweep: the
// velocity changes of all bodies, with the contacts as springs in series with the rigid bodies, and the set
// of contacts that bear, and of those that stick, by iteration (an active set).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/broadphase/SpatialPartition.h"
#include "smartsurf/world/field/SupportPatch.h"
#include "smartsurf/world/solver/ConstraintGraph.h"
#include "smartsurf/world/solver/ContactBatch.h"

namespace smartsurf::world {

class HeavyIslandSolver {
 public:
  // A load heavier than this many times the weight of the body that bears it makes an island heavy.
  static constexpr float kHeavyLoad = 16.0F;
  // Larger islands, and those beyond the sum, are left to the sweeps: the cost of one grows as the cube.
  static constexpr int kMaxBodies = 32, kMaxBodiesInAll = 256;

  void reset(int member_count);
  // Notes the lanes of a prepared batch in which a body bears a heavy load, or touches a body that much
  // heavier. `weight_impulse`: of a unit mass in a substep, u/s. Called by the member that prepares the
  // batch.
  void find_heavy_lanes(const ContactBatch&, ContactKind, const BatchPoints&, const BodyVelocity*,
                        float weight_impulse, int member);
  bool any_heavy_lane() const;
  // Builds the islands of the noted lanes. Called by one thread after all members have prepared their
  // batches.
  void build(const ConstraintGraph&, const BodyStore&, const SpatialPartition&, const BatchPoints&,
             const BodyVelocity*, std::span<SupportPatches>, const Vec3& gravity, float h_s);
  bool empty() const { return islands_.empty(); }

  // Corrects the impulses after a sweep of the solve stage (soft) or the relax stage.
  void solve(const BatchPoints&, const SolverBodies&, const SubstepParams& pair_params,
             const SubstepParams& static_params, bool is_soft);

 private:
  struct alignas(128) HeavyRows {
    std::vector<std::int32_t> rows;
  };
  // A spring in series with the rigid bodies: its velocity per velocities of the bodies (linear, angular),
  // its stiffness (impulse per speed), and the speed that it lacks.
  struct Spring {
    double jacobian[2][6], stiffness = 0.0, error = 0.0, impulse = 0.0, change = 0.0;
  };
  struct Point {
    std::int32_t index, lane;  // in the batch points
    std::int32_t row[2];       // −1: static
    std::int32_t body[2];      // in the island; −1: immovable
    bool is_sphere;            // its anchor is along the normal
    bool bears, sticks;
    double steady_impulse;  // normal, of the last relax stage
    Spring normal, tangent[2];
  };
  // The friction of a support patch whose cells rest and none of which slips: along x and y, and about z.
  struct PatchFriction {
    SupportPatch* patch;
    std::int32_t body;
    Spring spring[3];
  };
  struct Island {
    std::int32_t first_body, body_count, first_point, point_count, first_patch, patch_count;
    double greatest_impulse = 0.0;  // of a contact, mass·u/s in a substep
  };

  std::int32_t find_root(std::int32_t row);
  template <class Each>
  static void for_each_bearing_lane(const ConstraintGraph&, const BatchPoints&, Each each);
  void solve_island(const Island&, const BatchPoints&, const SolverBodies&, const SubstepParams& pair_params,
                    const SubstepParams& static_params, bool is_soft);
  static void set_up(Point&, const BatchPoints&, const SolverBodies&, const SubstepParams&, bool is_soft);
  static void set_up(PatchFriction&, const SolverBodies&);
  void add(const Spring&, const std::int32_t (&body)[2], bool is_stiff, double force);
  double lacking_speed(const Spring&, const std::int32_t (&body)[2]) const;

  std::vector<HeavyRows> heavy_rows_;  // one list per member
  std::vector<std::int32_t> parent_;   // by row: union-find
  std::vector<std::int32_t> island_of_row_, body_of_row_;
  std::vector<Island> islands_;
  std::vector<std::int32_t> rows_;  // of the islands' bodies
  std::vector<Point> points_;
  std::vector<PatchFriction> patches_;
  std::vector<double> matrix_, right_side_;  // of the current island
  int size_ = 0;
};

}  // namespace smartsurf::world
