// All bodies of a world as flat arrays, ascending by id: what moves, what it is made of, how it has moved.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "smartsurf/scene/ObjectState.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/surface/BodyForces.h"
#include "smartsurf/world/ContactKernels.h"
#include "smartsurf/world/Shape.h"

namespace smartsurf::world {

// What contacts ask of a body, in one place. Square roots, so that a product of two is their geometric mean.
struct Grip {
  float reach, friction_root, rolling_root, restitution;
};

// The inertia in own axes and its inverse: xx, yy, zz, xy, xz, yz.
struct OwnInertia {
  float inertia[6], inverse[6];
};

struct BodyStore {
  std::vector<scene::ObjectId> id;
  std::vector<Vec3> position;  // of the centre of mass
  std::vector<Quat> orientation;
  std::vector<Motion> motion;
  std::vector<float> mass;  // 0: fixed
  std::vector<std::unique_ptr<const Shape>> shape;
  std::vector<float> reach;
  // Of the shapes, what is asked of every body: a shape lies farther away.
  std::vector<char> round, revolves;
  std::vector<float> width;
  std::vector<Grip> grip;
  std::vector<OwnInertia> own_inertia;
  std::vector<surface::Wrench> wrench;  // of the step to come
  std::vector<char> asleep;
  std::vector<float> still_s;  // how long it has hardly moved

  // ---- derived for each step
  std::vector<Mat3> axes;  // of what is no sphere; those of a shape of revolution do not spin about its z
  std::vector<Shift> shift;
  std::vector<Inertia> inertia;

  int size() const { return static_cast<int>(id.size()); }
  bool fixed(std::size_t i) const { return mass[i] == 0.0F; }
  bool moves(std::size_t i) const { return !fixed(i) && !asleep[i]; }
  Vec3 velocity(std::size_t i) const { return Vec3(motion[i].velocity); }
  Vec3 spin(std::size_t i) const { return Vec3(motion[i].spin); }

  void add(scene::ObjectId, const scene::ObjectSpec&, const scene::Material&);
  void erase(std::size_t index);
  // Its index, or −1.
  int find(scene::ObjectId) const;
  void place(std::size_t index, const scene::Placement&);
  // Brings axes and inertia up to the orientation.
  void turn_axes(std::size_t index);
  // Asks for the memory that a body's motion takes, ahead of its use: threads take bodies by place, not by
  // index. Then for what turn_freely() takes besides.
  void fetch(std::size_t index) const;
  void fetch_turning(std::size_t index) const;
  // Moves and turns it as far as it got during the step. Of what is no sphere the axes are still to follow.
  void settle(std::size_t index);
  // Lets the gyroscopic effect act on bodies that are no spheres, as many as kLanes at most, and brings axes
  // and inertia up to the orientation.
  void turn_freely(std::span<const std::size_t> bodies, float dt_s);
};

// The rotation about an axis by an angle, given as one vector.
Quat turn_by(const Vec3& turn);

}  // namespace smartsurf::world
