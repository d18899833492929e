// Test fixture: NativeEngine::step() without sleeping, on a flat square field at height 0.
#pragma once

#include <cmath>
#include <limits>

#include "smartsurf/world/CollisionPipeline.h"
#include "smartsurf/world/solver/SkinSolver.h"
#include "smartsurf/world/solver/Solver.h"

namespace smartsurf::world {

inline surface::Field make_flat_field(int side) {
  surface::Field field;
  field.rows = field.columns = side;
  const auto cells = static_cast<std::size_t>(field.cells());
  field.height.assign(cells, 0.0F);
  field.speed.assign(cells, 0.0F);
  field.impulse.assign(cells, 0.0F);
  return field;
}

inline scene::ObjectSpec make_sphere(double radius) {
  scene::ObjectSpec object;
  object.shape = scene::ShapeKind::kSphere;
  object.radius = radius;
  return object;
}

struct StepFixture {
  static constexpr float kDt = 1.0F / 240.0F, kGravity = 9.81F;
  static constexpr float kNoGround = -std::numeric_limits<float>::infinity();

  explicit StepFixture(int side, float friction = 0.5F, float restitution = 0.0F, float gravity = kGravity)
      : field(make_flat_field(side)),
        settings{kDt, 4, Vec3(0, 0, -gravity), {0.0F, std::sqrt(friction), 0.0F, restitution}},
        pipeline(field, kDt, settings.substeps, kNoGround, gravity),
        solver(settings) {
    material.friction = friction;
    material.rolling_friction = 0.0;
    material.restitution = restitution;
  }

  // Returns the body's index.
  std::size_t add(const scene::ObjectSpec& object, const Vec3& position,
                  const Vec3& velocity = Vec3::Zero()) {
    const auto i = static_cast<std::size_t>(bodies.size());
    bodies.add(static_cast<scene::ObjectId>(i), object, material);
    scene::ObjectStateUpdate update;
    update.position = position.cast<double>();
    update.velocity = velocity.cast<double>();
    bodies.set_state(i, update);
    pipeline.on_bodies_changed(bodies.size());
    return i;
  }

  void find_contacts() {
    pipeline.update_broadphase(bodies, member);
    pipeline.find_contacts(bodies, pair_contacts, static_contacts, member);
  }

  void step() {
    find_contacts();
    solver.step(bodies,
                {.partition = pipeline.partition(),
                 .pair_contacts = pair_contacts,
                 .static_contacts = static_contacts,
                 .pair_ranges = pipeline.pair_ranges(),
                 .static_ranges = pipeline.static_ranges(),
                 .supports = pipeline.supports(),
                 .cell_limits = {},
                 .has_wrenches = false,
                 .joints = joints,
                 .tips = tips,
                 .skin = skin,
                 .has_room = has_room},
                member);
    for (int row = 0; row < bodies.size(); ++row) {
      solver.store_body(bodies, pipeline.partition(), row);
      const std::size_t i = pipeline.partition().body(row);
      if (bodies.is_sphere[i])
        bodies.integrate_pose(i);
      else
        bodies.integrate_poses({{{i, kDt}}});
    }
  }

  // Sum of the normal impulses of the body's static contacts in the last step, mass·u/s.
  float static_impulse(std::size_t body) const {
    float sum = 0.0F;
    for (const Manifold& m : static_contacts.manifolds)
      if (m.a == static_cast<std::int32_t>(body))
        for (int k = m.first; k < m.first + m.count; ++k)
          sum += static_contacts.contacts[static_cast<std::size_t>(k)].total_normal_impulse;
    return sum;
  }

  surface::Field field;
  scene::Material material;
  StepSettings settings;
  BodyStore bodies;
  JointSolver joints;
  TipSolver tips;
  SkinSolver skin{kDt, -kGravity, 4};
  ImpactSolver::HasRoom has_room = [this](std::int32_t body, std::int32_t partner, float reach) {
    return pipeline.has_room(bodies, static_cast<std::size_t>(body), partner, reach);
  };
  CollisionPipeline pipeline;
  Solver solver;
  ContactList pair_contacts, static_contacts;
  Barrier barrier{1};
  Member member{0, 1, barrier};
};

}  // namespace smartsurf::world
