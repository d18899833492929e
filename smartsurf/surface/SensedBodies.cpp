#include "smartsurf/surface/SensedBodies.h"

#include <Eigen/Geometry>

#include "smartsurf/surface/WorkerPool.h"

namespace smartsurf::surface {
namespace {

Eigen::Vector3f extent_of(const scene::ObjectSpec& o) {
  if (o.shape == scene::ShapeKind::kCone)
    return {static_cast<float>(o.radius), static_cast<float>(o.height), 0.0F};
  return o.half_extents().cast<float>();
}

}  // namespace

void SensedBodies::update(const scene::Snapshot& snapshot, std::span<const scene::ObjectSpec> catalogue,
                          WorkerPool& pool) {
  for (std::size_t id = forms_.size(); id < catalogue.size(); ++id) {
    const scene::ObjectSpec& o = catalogue[id];
    forms_.push_back({extent_of(o), o.half_extents().cast<float>(), o.shape, o.solid.get()});
  }
  bodies_.resize(snapshot.objects());
  const auto work = [this, &snapshot](int begin, int end) {
    for (int k = begin; k < end; ++k) place(snapshot, static_cast<std::size_t>(k));
  };
  pool.for_rows(static_cast<int>(snapshot.objects()), work);
}

void SensedBodies::place(const scene::Snapshot& snapshot, std::size_t k) noexcept {
  const std::uint32_t id = snapshot.id[k];
  const Form& form = forms_[id];
  SensedBody& body = bodies_[k];
  body.centre = Eigen::Vector3f(snapshot.position[k].data());
  body.shape = form.shape;
  body.id = id;
  body.extent = form.extent;
  Eigen::Vector3f reach = form.half_extents;
  if (form.shape != scene::ShapeKind::kSphere) {
    const auto& q = snapshot.orientation[k];
    const Eigen::Matrix3f to_world = Eigen::Quaternionf(q[3], q[0], q[1], q[2]).toRotationMatrix();
    body.to_local = to_world.transpose();
    body.solid = form.solid;
    reach = to_world.cwiseAbs() * form.half_extents;
  }
  const bool somewhere = body.centre.allFinite() && reach.allFinite();
  body.reach_x = somewhere ? reach.x() : -1.0F;
  body.reach_y = somewhere ? reach.y() : -1.0F;
  body.reach_z = somewhere ? reach.z() : -1.0F;
}

}  // namespace smartsurf::surface
