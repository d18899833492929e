// All bodies of a world as flat arrays, ascending by id: what moves, what it is made of, how it has moved.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "smartsurf/scene/ObjectState.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/surface/actuators/BodyForces.h"
#include "smartsurf/world/narrowphase/Shape.h"
#include "smartsurf/world/solver/ContactKernels.h"

namespace smartsurf::world {

// What contacts ask of a body, in one place. Square roots, so that a product of two is their geometric mean.
struct SurfaceMaterial {
  float radius, friction_root, rolling_friction_root, restitution;
};

// The inertia in own axes and its inverse: xx, yy, zz, xy, xz, yz.
struct LocalInertia {
  float inertia[6], inverse[6];
};

struct BodyStore {
  std::vector<scene::ObjectId> id;
  std::vector<Vec3> position;  // of the centre of mass
  std::vector<Quat> orientation;
  std::vector<BodyVelocity> body_velocity;
  std::vector<float> mass;  // 0: fixed
  std::vector<std::unique_ptr<const Shape>> shape;
  std::vector<float> bounding_radius;
  // Of the shapes, what is asked of every body: a shape lies farther away.
  std::vector<char> is_sphere, is_axisymmetric;
  std::vector<float> width;
  std::vector<SurfaceMaterial> surface_material;
  std::vector<LocalInertia> local_inertia;
  std::vector<surface::Wrench> wrench;  // of the step to come
  std::vector<char> asleep;
  std::vector<float> sleep_timer_s;  // how long it has hardly moved

  // ---- derived for each step
  std::vector<Mat3> axes;  // of what is no sphere; those of a shape of revolution do not spin about its z
  std::vector<DeltaPose> delta_pose;
  std::vector<InverseInertia> world_inverse_inertia;

  int size() const { return static_cast<int>(id.size()); }
  bool is_static(std::size_t i) const { return mass[i] == 0.0F; }
  bool is_active(std::size_t i) const { return !is_static(i) && !asleep[i]; }
  Vec3 velocity(std::size_t i) const { return Vec3(body_velocity[i].velocity); }
  Vec3 angular_velocity(std::size_t i) const { return Vec3(body_velocity[i].angular_velocity); }

  void add(scene::ObjectId, const scene::ObjectSpec&, const scene::Material&);
  void erase(std::size_t index);
  // Its index, or −1.
  int find(scene::ObjectId) const;
  void apply_placement(std::size_t index, const scene::ObjectStateUpdate&);
  // Brings axes and inertia up to the orientation.
  void update_axes(std::size_t index);
  // Asks for the memory that a body's motion takes, ahead of its use: threads take bodies by place, not by
  // index. Then for what turn_freely() takes besides.
  void prefetch(std::size_t index) const;
  void prefetch_rotation(std::size_t index) const;
  // Moves and turns it as far as it got during the step. Of what is no sphere the axes are still to follow.
  void integrate_pose(std::size_t index);
  // Lets the gyroscopic effect act on bodies that are no spheres, as many as kLanes at most, and brings axes
  // and inertia up to the orientation.
  void integrate_gyroscopic(std::span<const std::size_t> bodies, float dt_s);
};

// The rotation about an axis by an angle, given as one vector.
Quat rotation_from_vector(const Vec3& rotation_vector);

}  // namespace smartsurf::world
