// All bodies of a world as a structure of arrays, ascending by id: state, material, shape and derived data.
//
// Every array has one entry per body. Functions that take one body touch that body's entries only and may run
// concurrently for different bodies; only add() and erase() allocate.
#pragma once

#include <algorithm>
#include <array>
#include <memory>
#include <span>
#include <vector>

#include "common/state/StateArchive.h"
#include "smartsurf/scene/ObjectState.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/surface/actuators/BodyForces.h"
#include "smartsurf/world/body/BodyRows.h"
#include "smartsurf/world/body/Shape.h"

namespace smartsurf::world {

struct RotationBatch;

// The radius and the material of a body, as contact preparation reads them. Friction is stored as a square
// root, so that the product of two entries is the geometric mean of the coefficients.
struct SurfaceMaterial {
  float radius, friction_root, rolling_friction_root, restitution;
  bool operator==(const SurfaceMaterial&) const = default;
};

// Principal moments of inertia about the centre of mass and, in body axes, the directions of the least and
// the greatest.
struct PrincipalInertia {
  double least_axis[3] = {1, 0, 0}, greatest_axis[3] = {0, 0, 1};
  double moments[3] = {};  // least, middle, greatest; 0 for a static body

  // 0 up to a least moment of an eighth of the middle one, 1 from a sixteenth on.
  double slenderness() const { return std::clamp(2.0 - 16.0 * moments[0] / moments[1], 0.0, 1.0); }
};

// Orientation and angular momentum of a non-sphere in double precision, see RotationBatch.
struct RotationState {
  double orientation[4] = {0, 0, 0, 1};  // x, y, z, w
  double momentum[3] = {};               // world axes
  float angular_velocity[3] = {};        // at this momentum; the solver's changes are relative to it
};

// Sums over the steps of a period of rest, those of its first half negative.
struct RestMotion {
  Vec3 velocity{0, 0, 0}, angular_velocity{0, 0, 0};  // u/s, rad/s
};

// Two bodies that a joint connects.
struct BodyLink {
  std::int32_t a, b;  // b = −1: the table
  bool collide;       // whether they collide as well
  bool is_rigid;      // whether it is a fixed joint
};

// A body of an island that is solved at once.
struct IslandBody {
  std::int32_t island, body;
};

struct BodyStore {
  std::vector<scene::ObjectId> id;
  std::vector<Vec3> position;  // of the centre of mass, u
  // Rounding error of the position, u: far from the origin, the motion of a slow body in a step is
  // less than its last bit.
  std::vector<Vec3> position_remainder;
  std::vector<Quat> orientation;
  std::vector<BodyVelocity> body_velocity;
  std::vector<float> mass;  // 0 for a static body
  std::vector<std::unique_ptr<const Shape>> shape;
  std::vector<float> bounding_radius;  // about the centre of mass, u
  // Copies of Shape members that are read for every body, to save the pointer dereference.
  std::vector<char> is_sphere, is_axisymmetric;
  // A round shape that is not axisymmetric in its mass. The points of a cached manifold would turn with it.
  std::vector<char> rolls_unevenly;
  std::vector<float> width;
  std::vector<SurfaceMaterial> surface_material;
  std::vector<PrincipalInertia> inertia;
  std::vector<RotationState> rotation_state;
  std::vector<surface::Wrench> wrench;  // of the next step
  std::vector<char> asleep;
  std::vector<float> sleep_timer_s;     // time since the body last moved or accelerated noticeably
  std::vector<RestMotion> rest_motion;  // since the sleep timer started
  std::vector<char> is_jointed;         // whether any link has the body
  std::vector<Vec3> local_origin;       // of the shape, from the centre of mass, body axes, u; 0 for a sphere
  bool has_offsets = false;             // whether any body's centre of mass is not its origin
  int non_spheres = 0, restituting = 0;  // numbers of bodies

  // One link per joint, in the order of the joints; JointSolver keeps them.
  std::vector<BodyLink> links;

  // ---- derived in each step
  // Rotation matrix; unused for spheres. Axes of an axisymmetric shape do not follow its spin about its own
  // z.
  std::vector<Mat3> axes;
  std::vector<DeltaPose> delta_pose;  // motion during the step
  std::vector<InverseInertia> world_inverse_inertia;
  std::vector<Vec3> origin_offset;  // local_origin in world axes

  int size() const { return static_cast<int>(id.size()); }
  bool is_static(std::size_t i) const { return mass[i] == 0.0F; }
  bool is_active(std::size_t i) const { return !is_static(i) && !asleep[i]; }
  // True if its shape is a sphere or symmetric about an axis, wherever its mass is.
  bool is_round(std::size_t i) const { return is_sphere[i] || is_axisymmetric[i] || rolls_unevenly[i]; }
  // False if a link excludes contacts between the two bodies.
  bool may_touch(std::size_t i, std::size_t j) const {
    return !is_jointed[i] || !is_jointed[j] || !is_excluded(i, j);
  }
  // Replaces the links.
  void set_links(std::vector<BodyLink>);
  // Calls visit(other) for the bodies that links connect with a body, in the order of the links.
  template <class Visit>
  void for_each_linked(std::size_t i, Visit visit) const {
    if (i + 1 >= first_linked_.size()) return;
    for (std::int32_t k = first_linked_[i]; k < first_linked_[i + 1]; ++k) visit(linked_[k]);
  }
  // Position and velocity of the shape's origin (what collision detection and the scene call the body's
  // position), not of the centre of mass, u and u/s.
  Vec3 origin(std::size_t i) const {
    return has_offsets ? Vec3(position[i] + origin_offset[i]) : position[i];
  }
  Vec3 origin_velocity(std::size_t i) const {
    return has_offsets ? Vec3(velocity(i) + angular_velocity(i).cross(origin_offset[i])) : velocity(i);
  }
  Vec3 velocity(std::size_t i) const { return Vec3(body_velocity[i].velocity); }
  Vec3 angular_velocity(std::size_t i) const { return Vec3(body_velocity[i].angular_velocity); }

  // All arrays but the shapes.
  void archive(common::StateArchive& a) {
    a(id, position, position_remainder, orientation, body_velocity, mass, bounding_radius, is_sphere,
      is_axisymmetric, rolls_unevenly, width, surface_material, inertia, rotation_state, wrench, asleep,
      sleep_timer_s, rest_motion, is_jointed, links, excluded_pairs_, axes, delta_pose, world_inverse_inertia,
      local_origin, has_offsets, origin_offset, non_spheres, restituting);
    if (!a.saves()) index_links();
  }

  // The id must exceed all ids in the store.
  void add(scene::ObjectId, const scene::ObjectSpec&, const scene::Material&);
  void erase(std::size_t index);
  // Index of the body, or −1.
  int find(scene::ObjectId) const;
  // Sets the values that are present, of the origin; ignores velocities of a static body.
  void set_state(std::size_t index, const scene::ObjectStateUpdate&);
  // Recomputes axes, world inertia and rotation_state from orientation and angular velocity.
  void update_axes(std::size_t index);
  // Inverse moment of inertia of a dynamic sphere.
  float inverse_inertia_of_sphere(std::size_t index) const {
    return static_cast<float>(1.0 / inertia[index].moments[1]);
  }
  // prefetch() loads the entries that integrate_pose() uses, prefetch_rotation() those that integrate_poses()
  // uses in addition: threads visit bodies in spatial order, which the hardware prefetcher cannot predict.
  void prefetch(std::size_t index) const;
  void prefetch_rotation(std::size_t index) const;
  // Applies delta_pose to a sphere.
  void integrate_pose(std::size_t index);
  // A non-sphere, and for how long it rotates freely: the step, or 0 if its delta_pose is to be applied as it
  // is.
  struct Rotating {
    std::size_t body;
    float free_time_s;
  };
  // Applies the delta poses of 1 … kLanes non-spheres, whose rotation becomes that of a free body about it.
  // Keeps the angular momentum, and recomputes angular velocity, axes and world inertia.
  void integrate_poses(std::span<const Rotating>);
  // The rotation vector of a non-sphere that integrate_poses() would turn for the whole step of `dt_s` after
  // the solver has left it with that velocity and delta pose.
  Vec3 turn_in_step(std::size_t index, const BodyVelocity&, const DeltaPose&, float dt_s) const;

 private:
  using BodyPair = std::array<std::int32_t, 2>;  // ascending
  bool is_excluded(std::size_t i, std::size_t j) const;
  void index_links();
  // Adds the translation of delta_pose to the position (compensated summation, Kahan 1965).
  void translate(std::size_t i);
  // Adds to the numbers of bodies of the body's kinds.
  void count_kind(std::size_t i, int count);
  void load_rotation(RotationBatch&, std::size_t lane, const Rotating&, const BodyVelocity&,
                     const DeltaPose&) const;
  void integrate_rotations(std::span<const Rotating>);

  std::vector<BodyPair> excluded_pairs_;  // ascending
  // By body, and one more: where in linked_ the bodies begin that its links connect with it.
  std::vector<std::int32_t> first_linked_, linked_;
};

// Quaternion of a rotation vector (axis times angle, rad).
Quat rotation_from_vector(const Vec3& rotation_vector);

}  // namespace smartsurf::world
