#include "smartsurf/world/bullet/CellPool.h"

#include <algorithm>
#include <cmath>

#include "smartsurf/world/bullet/BulletShape.h"
#include "smartsurf/world/field/TipsOnField.h"

namespace smartsurf::world {
namespace {

// Range of bucket or grid indices whose values lie in [low, high].
struct Range {
  int begin, end;
};

Range index_range(double low, double high, int count) {
  const auto limit = static_cast<double>(count);
  return {static_cast<int>(std::clamp(std::floor(low), 0.0, limit)),
          static_cast<int>(std::clamp(std::floor(high) + 1.0, 0.0, limit))};
}

}  // namespace

CellPool::CellPool(btDynamicsWorld& world, const surface::Field& field, double depth)
    : world_(world),
      field_(field),
      depth_(depth),
      box_(make_box(
          {static_cast<double>(field.half_top_x), static_cast<double>(field.half_top_y), 0.5 * depth})) {
  for (const surface::CellTip& tip : field.tips) tip_shapes_.push_back(make_tip_shape(field, tip, depth));
  if (field.is_rectangular() || field.x.empty()) return;
  const auto [min_x, max_x] = std::minmax_element(field.x.begin(), field.x.end());
  const auto [min_y, max_y] = std::minmax_element(field.y.begin(), field.y.end());
  low_x_ = static_cast<double>(*min_x), low_y_ = static_cast<double>(*min_y);
  const double extent_x = static_cast<double>(*max_x) - low_x_,
               extent_y = static_cast<double>(*max_y) - low_y_;
  bucket_size_ = std::max({static_cast<double>(field.pitch), extent_x / 1024.0, extent_y / 1024.0});
  bucket_columns_ = static_cast<int>(extent_x / bucket_size_) + 1;
  bucket_rows_ = static_cast<int>(extent_y / bucket_size_) + 1;
  buckets_.resize(bucket_rows_ * bucket_columns_);
  for (int cell = 0; cell < field.cells(); ++cell) {
    const Eigen::Vector2f centre = field.centre(cell);
    const int c = static_cast<int>((static_cast<double>(centre.x()) - low_x_) / bucket_size_);
    const int r = static_cast<int>((static_cast<double>(centre.y()) - low_y_) / bucket_size_);
    buckets_[r * bucket_columns_ + c].push_back(cell);
  }
}

CellPool::~CellPool() {
  for (const Column& column : columns_) world_.removeRigidBody(column.body);
}

template <class Visit>
void CellPool::for_each_cell_near(const Box& box, Visit visit) const {
  const double reach =
      std::max(std::hypot(static_cast<double>(field_.half_top_x), static_cast<double>(field_.half_top_y)),
               static_cast<double>(field_.tip_reach));
  if (field_.is_rectangular()) {
    const auto pitch = static_cast<double>(field_.pitch);
    const Range columns =
        index_range(std::ceil((box.min.x() - reach) / pitch), (box.max.x() + reach) / pitch, field_.columns);
    const Range rows =
        index_range(std::ceil((box.min.y() - reach) / pitch), (box.max.y() + reach) / pitch, field_.rows);
    for (int r = rows.begin; r < rows.end; ++r)
      for (int c = columns.begin; c < columns.end; ++c) visit(field_.index(field_.rows - 1 - r, c));
    return;
  }
  const Range columns = index_range((box.min.x() - reach - low_x_) / bucket_size_,
                                    (box.max.x() + reach - low_x_) / bucket_size_, bucket_columns_);
  const Range rows = index_range((box.min.y() - reach - low_y_) / bucket_size_,
                                 (box.max.y() + reach - low_y_) / bucket_size_, bucket_rows_);
  for (int r = rows.begin; r < rows.end; ++r)
    for (int c = columns.begin; c < columns.end; ++c)
      for (const int cell : buckets_[r * bucket_columns_ + c]) {
        const Eigen::Vector2d centre = field_.centre(cell).cast<double>();
        if (centre.x() + reach >= box.min.x() && centre.x() - reach <= box.max.x() &&
            centre.y() + reach >= box.min.y() && centre.y() - reach <= box.max.y())
          visit(cell);
      }
}

void CellPool::find_cells(const Box& box, double dt_s) {
  for_each_cell_near(box, [&](int cell) {
    double rise = std::max(0.0, static_cast<double>(field_.speed[cell]) * dt_s);
    if (!field_.is_column(cell)) rise += static_cast<double>(field_.tip_reach);  // a tilted plate's corner
    if (static_cast<double>(field_.height[cell]) + rise >= box.min.z()) wanted_.push_back(cell);
  });
}

btRigidBody* CellPool::take_body(int cell) {
  if (free_.empty()) {
    btRigidBody::btRigidBodyConstructionInfo info(0.0, nullptr, box_.get());
    auto& body = bodies_.emplace_back(std::make_unique<btRigidBody>(info));
    body->setCollisionFlags(btCollisionObject::CF_KINEMATIC_OBJECT);
    body->setActivationState(DISABLE_DEACTIVATION);
    free_.push_back(body.get());
  }
  btRigidBody* body = free_.back();
  free_.pop_back();
  body->setUserIndex(cell_user_index(cell));
  const int tip = field_.has_tips() ? field_.tip_of_cell[cell] : -1;
  body->setCollisionShape(tip < 0 ? box_.get() : tip_shapes_[tip].shape);
  return body;
}

void CellPool::select_near(std::span<const Box> boxes, double dt_s) {
  wanted_.clear();
  for (const Box& box : boxes) find_cells(box, dt_s);
  std::sort(wanted_.begin(), wanted_.end());
  wanted_.erase(std::unique(wanted_.begin(), wanted_.end()), wanted_.end());
  next_columns_.clear();
  auto old = columns_.begin();
  auto release_before = [&](int cell) {
    for (; old != columns_.end() && old->cell < cell; ++old) {
      world_.removeRigidBody(old->body);
      free_.push_back(old->body);
    }
  };
  for (const int cell : wanted_) {
    release_before(cell);
    Column column{cell, static_cast<double>(field_.height[cell]), static_cast<double>(field_.speed[cell]),
                  0.0, nullptr};
    const bool is_new = old == columns_.end() || old->cell != cell;
    column.body = is_new ? take_body(cell) : (old++)->body;
    update_body(column);
    if (is_new)
      world_.addRigidBody(column.body, btBroadphaseProxy::StaticFilter,
                          btBroadphaseProxy::AllFilter ^ btBroadphaseProxy::StaticFilter);
    next_columns_.push_back(column);
  }
  for (; old != columns_.end(); ++old) {
    world_.removeRigidBody(old->body);
    free_.push_back(old->body);
  }
  columns_.swap(next_columns_);
}

CellPool::Column& CellPool::column(int cell) {
  return *std::lower_bound(columns_.begin(), columns_.end(), cell,
                           [](const Column& c, int wanted) { return c.cell < wanted; });
}

void CellPool::update_body(const Column& column) {
  const Index cell = column.cell;
  if (field_.has_tips() && field_.tip_of_cell[cell] >= 0) {
    const TipFrame frame(field_, cell, static_cast<float>(column.elapsed_s));
    btTransform tip_pose(to_bt(Eigen::Quaterniond(frame.axes.cast<double>()).normalized()),
                         to_bt(frame.origin));
    tip_pose.getOrigin().setZ(column.top);
    column.body->setWorldTransform(tip_pose);
    column.body->setInterpolationWorldTransform(tip_pose);
    column.body->setLinearVelocity(
        {static_cast<double>(frame.velocity.x()), static_cast<double>(frame.velocity.y()), column.speed});
    column.body->setAngularVelocity(to_bt(frame.angular_velocity));
    return;
  }
  const Eigen::Vector2d centre = field_.centre(column.cell).cast<double>();
  btTransform pose(btQuaternion(btVector3(0, 0, 1), static_cast<double>(field_.angle_of(column.cell))),
                   btVector3(centre.x(), centre.y(), column.top - 0.5 * depth_));
  column.body->setWorldTransform(pose);
  column.body->setInterpolationWorldTransform(pose);
  column.body->setLinearVelocity({0, 0, column.speed});
}

}  // namespace smartsurf::world
