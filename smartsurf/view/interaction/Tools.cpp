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
  drop_spec.size = 1.5 * surface.pitch;
  drop_spec.height = 4.0 * surface.pitch;
}

bool Tools::press(const Ray& ray, const FrameInput& input, bool pull) {
  const auto hit = pick(ray, surface_, input);
  if (pull) {
    if (hit && hit->item.kind == SceneItem::Kind::kObject) start_pull(*hit, ray, input);
    return pull_.has_value();
  }
  if (active_tool == Tool::kPick || !hit) return false;
  const bool cell = hit->item.kind == SceneItem::Kind::kCell;
  if (active_tool == Tool::kDrop) request_drop(hit->point);
  if (active_tool == Tool::kPoke && cell) poke_ = Poke{hit->item.row, hit->item.column, poke_height};
  if (active_tool == Tool::kBreak && cell)
    fault_request_ = Fault{hit->item.row, hit->item.column, fault_kind};
  return active_tool != Tool::kPoke || cell;
}

void Tools::start_pull(const PickHit& hit, const Ray& ray, const FrameInput& input) {
  const auto i = find_object_index(input.snapshot, hit.item.object);
  if (!i || input.catalogue[hit.item.object].fixed) return;
  const Pose pose = pose_of(input.snapshot, *i);
  selected_ = hit.item;
  pull_ = Pull{hit.item.object, pose.orientation.conjugate() * (hit.point - pose.position), hit.point};
  pull_plane_normal_ = ray.direction;
}

// The target moves in the plane through the anchor that faced the eye when the pull began.
void Tools::move(const Ray& ray, const FrameInput& input) {
  if (pull_) {
    const double facing = ray.direction.dot(pull_plane_normal_);
    const double t = (pull_->target - ray.origin).dot(pull_plane_normal_) / facing;
    if (std::abs(facing) > 1e-3 && t > 0.0) pull_->target = ray.origin + t * ray.direction;
  }
  if (!poke_) return;
  const auto hit = pick(ray, surface_, input);
  if (hit && hit->item.kind == SceneItem::Kind::kCell) {
    poke_->row = hit->item.row;
    poke_->column = hit->item.column;
  }
}

void Tools::release() {
  pull_.reset();
  poke_.reset();
}

void Tools::select(const Ray& ray, const FrameInput& input) {
  const auto hit = pick(ray, surface_, input);
  selected_ = hit ? std::optional(hit->item) : std::nullopt;
}

void Tools::cancel() {
  release();
  if (active_tool == Tool::kPick) selected_.reset();
  active_tool = Tool::kPick;
}

void Tools::request_drop(const Eigen::Vector3d& point) {
  scene::ObjectSpec object;
  object.shape = drop_spec.shape;
  object.radius = drop_spec.size;
  object.height = drop_spec.shape == scene::ShapeKind::kCapsule ? 4.0 * drop_spec.size : 2.0 * drop_spec.size;
  object.size = Eigen::Vector3d::Constant(2.0 * drop_spec.size);
  object.position = point + Eigen::Vector3d(0.0, 0.0, drop_spec.height + drop_spec.size);
  object.material = surface_.material;
  object.colour = drop_spec.colour;
  object.label = "dropped";
  drop_request_ = object;
}

Eigen::Vector3d Tools::anchor_position(const Pull& pull, const scene::Snapshot& snapshot) {
  const auto i = find_object_index(snapshot, pull.object);
  if (!i) return pull.target;
  const Pose pose = pose_of(snapshot, *i);
  return pose.position + pose.orientation * pull.local_anchor;
}

}  // namespace smartsurf::view
