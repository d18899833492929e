#include "smartsurf/view/interaction/Tools.h"

#include <cmath>
#include <utility>

namespace smartsurf::view {
namespace {

struct Pose {
  Eigen::Vector3d position;
  Eigen::Quaterniond orientation;
};

Pose pose_of(const scene::Snapshot& snapshot, std::size_t i) {
  const auto& p = snapshot.position[i];
  const auto& q = snapshot.orientation[i];
  return {{p[0], p[1], p[2]}, Eigen::Quaterniond(q[3], q[0], q[1], q[2])};
}

}  // namespace

Tools::Tools(const scene::SurfaceSpec& surface)
    : poke_height(0.5 * (surface.pin.min_height + surface.pin.max_height)), surface_(surface) {
  drop.size = 1.5 * surface.pitch;
  drop.height = 4.0 * surface.pitch;
}

bool Tools::press(const Ray& ray, const FrameInput& moment, bool pull) {
  const auto hit = pick(ray, surface_, moment);
  if (pull) {
    if (hit && hit->thing.kind == Thing::Kind::kObject) grip(*hit, ray, moment);
    return pull_.has_value();
  }
  if (tool == Tool::kPick || !hit) return false;
  const bool cell = hit->thing.kind == Thing::Kind::kCell;
  if (tool == Tool::kDrop) drop_at(hit->point);
  if (tool == Tool::kPoke && cell) poke_ = Poke{hit->thing.row, hit->thing.column, poke_height};
  if (tool == Tool::kBreak && cell) broken_ = Fault{hit->thing.row, hit->thing.column, fault};
  return tool != Tool::kPoke || cell;
}

void Tools::grip(const Hit& hit, const Ray& ray, const FrameInput& moment) {
  const auto i = index_of(moment.snapshot, hit.thing.object);
  if (!i || moment.catalogue[hit.thing.object].fixed) return;
  const Pose pose = pose_of(moment.snapshot, *i);
  selected_ = hit.thing;
  pull_ = Pull{hit.thing.object, pose.orientation.conjugate() * (hit.point - pose.position), hit.point};
  pull_plane_ = ray.direction;
}

// The target stays in the plane through the grip that faced the eye when it was gripped.
void Tools::move(const Ray& ray, const FrameInput& moment) {
  if (pull_) {
    const double facing = ray.direction.dot(pull_plane_);
    const double t = (pull_->target - ray.origin).dot(pull_plane_) / facing;
    if (std::abs(facing) > 1e-3 && t > 0.0) pull_->target = ray.origin + t * ray.direction;
  }
  if (!poke_) return;
  const auto hit = pick(ray, surface_, moment);
  if (hit && hit->thing.kind == Thing::Kind::kCell) {
    poke_->row = hit->thing.row;
    poke_->column = hit->thing.column;
  }
}

void Tools::release() {
  pull_.reset();
  poke_.reset();
}

void Tools::select(const Ray& ray, const FrameInput& moment) {
  const auto hit = pick(ray, surface_, moment);
  selected_ = hit ? std::optional(hit->thing) : std::nullopt;
}

void Tools::escape() {
  release();
  if (tool == Tool::kPick) selected_.reset();
  tool = Tool::kPick;
}

void Tools::drop_at(const Eigen::Vector3d& point) {
  scene::ObjectSpec object;
  object.shape = drop.shape;
  object.radius = drop.size;
  object.height = drop.shape == scene::ShapeKind::kCapsule ? 4.0 * drop.size : 2.0 * drop.size;
  object.size = Eigen::Vector3d::Constant(2.0 * drop.size);
  object.position = point + Eigen::Vector3d(0.0, 0.0, drop.height + drop.size);
  object.material = surface_.material;
  object.colour = drop.colour;
  object.label = "dropped";
  dropped_ = object;
}

Eigen::Vector3d Tools::grip_of(const Pull& pull, const scene::Snapshot& snapshot) {
  const auto i = index_of(snapshot, pull.object);
  if (!i) return pull.target;
  const Pose pose = pose_of(snapshot, *i);
  return pose.position + pose.orientation * pull.grip;
}

}  // namespace smartsurf::view
