// The unit of length of a world: the pitch of its surface.
//
// All tolerances of the engines are constants in this unit, so a scene behaves alike whether it is described
// in metres or in centimetres. Lengths are converted at the world's interface only; everything inside is in
// world units. Times and masses are the same in both. A pitch of 1 u changes no bit and copies no field.
#pragma once

#include <memory>
#include <vector>

#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/ObjectState.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/surface/Field.h"
#include "smartsurf/surface/actuators/BodyForces.h"
#include "smartsurf/world/body/Vec.h"

namespace smartsurf::world {

class LengthUnit {
 public:
  // `length_u`: the length of the unit in the scene's u, > 0.
  explicit LengthUnit(double length_u)
      : to_scene_(length_u),
        to_world_(1.0 / length_u),
        to_scene_f_(static_cast<float>(length_u)),
        to_world_f_(static_cast<float>(1.0 / length_u)) {}

  bool is_one() const { return to_scene_ == 1.0; }

  // These convert lengths and what is proportional to a length: speeds, accelerations, forces, impulses.
  double to_world(double scene) const { return scene * to_world_; }
  Eigen::Vector3d to_world(const Eigen::Vector3d& scene) const { return scene * to_world_; }
  double to_scene(double world) const { return world * to_scene_; }
  Eigen::Vector3d to_scene(const Eigen::Vector3d& world) const { return world * to_scene_; }
  float to_scene(float world) const { return world * to_scene_f_; }
  Vec3 to_scene(const Vec3& world) const { return world * to_scene_f_; }

  // Objects made of the same solid share its converted form.
  scene::ObjectSpec to_world(const scene::ObjectSpec&, const scene::Material&);
  scene::ObjectStateUpdate to_world(scene::ObjectStateUpdate) const;
  scene::Material to_world(scene::Material) const;
  scene::JointSpec to_world(scene::JointSpec) const;
  scene::JointSpring to_world(scene::JointKind, scene::JointSpring) const;
  scene::JointMotor to_world(scene::JointKind, scene::JointMotor) const;
  scene::JointState to_scene(scene::JointKind, scene::JointState) const;
  surface::Wrench to_world(const surface::Wrench&) const;

  // A copy of the field in world units.
  surface::Field to_world(const surface::Field&) const;
  // Brings the motion of a copy up to date. Costs nothing while no cell moves. `pool` may be null.
  void update_motion(const surface::Field& scene, surface::Field& world, common::ThreadPool* pool) const;
  // Writes speeds that the physics lowered back.
  void return_lowered_speeds(const surface::Field& world, surface::Field& scene) const;
  // Writes the velocities of a tip that yielded back.
  void return_yielding_tip(const surface::Field& world, std::size_t cell, surface::Field& scene) const;

  // Writes the motion of an elastic skin back.
  void return_skin(const surface::Skin& world, surface::Skin& scene) const;

 private:
  // Factors from the scene to the world, for a joint's coordinate, its effort, and effort per coordinate.
  struct JointScales {
    double coordinate, effort, stiffness;
  };
  JointScales joint_scales(scene::JointKind) const;
  void update_skin(const surface::Skin& scene, surface::Skin& world) const;

  double to_scene_, to_world_;
  float to_scene_f_, to_world_f_;
  struct ConvertedSolid {
    std::weak_ptr<const scene::Solid> scene, world;
  };
  std::vector<ConvertedSolid> solids_;
};

}  // namespace smartsurf::world
