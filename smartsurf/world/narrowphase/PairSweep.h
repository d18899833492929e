// The motion of two bodies in a step, and when they first touch, by conservative advancement (Mirtich 1996).
//
// Both move straight at their velocities and turn uniformly. Contacts found at the time of impact are
// speculative ones of the start of the step: their separations are what is left to travel, so that the solver
// lets the bodies travel that far.
#pragma once

#include <limits>
#include <span>
#include <vector>

#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/narrowphase/Gjk.h"

namespace smartsurf::world {

class PairSweep {
 public:
  static constexpr float kNever = std::numeric_limits<float>::infinity();

  // The bodies move at their velocities at the start of the step, or by the given motions.
  PairSweep(const BodyStore& bodies, std::size_t a, std::size_t b, float dt_s);
  PairSweep(const BodyStore& bodies, std::size_t a, std::size_t b, float dt_s, const DeltaPose& motion_a,
            const DeltaPose& motion_b);

  // Upper bound of the motion of any point of a relative to b in the step, u.
  float travel() const { return travel_; }
  // The time from the start of the step, s; kNever if they do not meet. Parts that touch each other at the
  // start and do not approach are left out.
  float time_of_impact() const;
  // The first time at which parts that were separate at the start overlap by more than resting contacts
  // allow; kNever if none do. `are_pierced`: parts overlap so far at the start that their sides are unknown;
  // they have no such time.
  struct Overlap {
    float time_s = kNever;
    bool are_pierced = false;
  };
  Overlap find_overlap() const;
  // Appends the contacts of the bodies as they stand at that time, with separations up to `margin`, normals
  // from b to a, and anchors from the origin of a.
  void collide_at(float time_s, float margin, std::vector<Contact>& out) const;
  // Corrects the contacts from `first` on, found at that time, where a body has several parts
  // (InternalEdges.h).
  void correct_internal_edges(float time_s, std::vector<Contact>&, std::size_t first) const;
  // Makes contacts found at that time those of the start of the step.
  void move_to_start(float time_s, std::span<Contact> contacts) const;
  // The origin of a at that time.
  Vec3 origin_of_a(float time_s) const { return a_.at(time_s).centre; }

 private:
  struct Placed {
    const Shape& shape;
    Vec3 centre;
    Mat3 axes;
  };
  struct Motion {
    const Shape& shape;
    Vec3 position, velocity, angular_velocity, local_origin;  // of the centre of mass; origin in body axes
    Mat3 axes;
    Vec3 origin_offset;
    float turning_speed;  // of any point about the centre of mass, u/s
    bool is_sphere;

    Motion(const BodyStore&, std::size_t body);
    Motion(const BodyStore&, std::size_t body, float dt_s, const DeltaPose&);
    Placed at(float time_s) const;
    Vec3 displacement(float time_s, const Vec3& anchor) const {
      return time_s * (velocity + angular_velocity.cross(anchor));
    }
  };
  struct Gap {
    Vec3 normal;  // unit, from b to a; undefined if they overlap
    float distance;
  };
  Gap gap(const ConvexPart& part_a, const ConvexPart& part_b, const Placed& a, const Placed& b,
          float reach) const;
  static Gap gap(const ConvexProxy& a, const ConvexProxy& b, float reach);
  // The first time at which the distance of two parts is in the range, which they are advanced to the middle
  // of.
  struct Range {
    float low, high;
  };
  template <class AtStart>
  float advance(const ConvexPart& part_a, const ConvexPart& part_b, float until_s, Range,
                AtStart at_start) const;

  PairSweep(Motion a, Motion b, float dt_s, bool anchors_follow_b);

  Motion a_, b_;
  float dt_s_, turning_speed_, travel_;
  bool anchors_follow_b_;  // of both bodies, it is b for which the contact points are right
};

}  // namespace smartsurf::world
