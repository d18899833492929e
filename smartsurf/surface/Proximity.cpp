#include "smartsurf/surface/Proximity.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartsurf/surface/WorkerPool.h"

namespace smartsurf::surface {

namespace {

// Where a vertical line crosses a solid: z in [low, high], or nothing when low > high.
struct Interval {
  float low = std::numeric_limits<float>::infinity();
  float high = -std::numeric_limits<float>::infinity();
};

void clip_slab(float origin, float direction, float half, float& t0, float& t1) {
  if (std::abs(direction) < 1e-12F) {
    if (std::abs(origin) > half) t1 = -std::numeric_limits<float>::infinity();
    return;
  }
  const float a = (-half - origin) / direction, b = (half - origin) / direction;
  t0 = std::max(t0, std::min(a, b));
  t1 = std::min(t1, std::max(a, b));
}

Interval crossing(scene::ShapeKind shape, const Eigen::Vector3f& o, const Eigen::Vector3f& d,
                  const Eigen::Vector3f& extent) {
  float t0 = -std::numeric_limits<float>::infinity(), t1 = std::numeric_limits<float>::infinity();
  clip_slab(o.z(), d.z(), extent.z(), t0, t1);
  if (shape == scene::ShapeKind::kBox) {
    clip_slab(o.x(), d.x(), extent.x(), t0, t1);
    clip_slab(o.y(), d.y(), extent.y(), t0, t1);
    return {t0, t1};
  }
  // Cylinder: |o + t·d| across the axis equals the radius.
  const float a = d.x() * d.x() + d.y() * d.y();
  const float b = o.x() * d.x() + o.y() * d.y();
  const float c = o.x() * o.x() + o.y() * o.y() - extent.x() * extent.x();
  if (a < 1e-12F) return c <= 0.0F ? Interval{t0, t1} : Interval{};
  const float discriminant = b * b - a * c;
  if (discriminant < 0.0F) return {};
  const float root = std::sqrt(discriminant);
  return {std::max(t0, (-b - root) / a), std::min(t1, (-b + root) / a)};
}

}  // namespace

Proximity::Proximity(const scene::SurfaceSpec& spec, double range)
    : spec_(spec),
      range_(static_cast<float>(range)),
      distance_(static_cast<std::size_t>(spec.cells()), range_),
      hit_(distance_.size(), 0.0F),
      dirty_(static_cast<std::size_t>(spec.rows), 0) {}

void Proximity::sense(const scene::Snapshot& snapshot, std::span<const scene::ObjectSpec> catalogue,
                      WorkerPool& pool) {
  footprints_.clear();
  const auto pitch = static_cast<float>(spec_.pitch);
  const float north = static_cast<float>(spec_.rows - 1) * pitch;
  for (std::size_t k = 0; k < snapshot.objects(); ++k) {
    const scene::ObjectSpec& object = catalogue[snapshot.id[k]];
    Footprint f;
    f.shape = object.shape;
    f.centre = Eigen::Vector3f(snapshot.position[k].data());
    const auto& q = snapshot.orientation[k];
    const Eigen::Matrix3f to_world = Eigen::Quaternionf(q[3], q[0], q[1], q[2]).toRotationMatrix();
    f.to_local = to_world.transpose();
    f.extent = object.half_extents().cast<float>();
    const Eigen::Vector3f reach =
        f.shape == scene::ShapeKind::kSphere ? f.extent : Eigen::Vector3f(to_world.cwiseAbs() * f.extent);
    if (!f.centre.allFinite()) continue;
    auto cell = [pitch](float u) { return std::clamp(u / pitch, -1e6F, 1e6F); };
    f.column_begin = std::max(0, static_cast<int>(std::ceil(cell(f.centre.x() - reach.x()))));
    f.column_end = std::min(spec_.columns, static_cast<int>(std::floor(cell(f.centre.x() + reach.x()))) + 1);
    f.row_begin = std::max(0, static_cast<int>(std::ceil(cell(north - f.centre.y() - reach.y()))));
    f.row_end = std::min(spec_.rows, static_cast<int>(std::floor(cell(north - f.centre.y() + reach.y()))) + 1);
    if (f.row_begin < f.row_end && f.column_begin < f.column_end) footprints_.push_back(f);
  }
  pool.for_rows(spec_.rows, [&](int begin, int end) { sense_rows(snapshot, begin, end); });
}

void Proximity::sense_rows(const scene::Snapshot& snapshot, int begin, int end) {
  const auto columns = static_cast<std::size_t>(spec_.columns);
  const auto pitch = static_cast<float>(spec_.pitch);
  for (int r = begin; r < end; ++r) {
    if (!dirty_[static_cast<std::size_t>(r)]) continue;
    std::fill_n(distance_.begin() + static_cast<std::ptrdiff_t>(r * spec_.columns), columns, range_);
    std::fill_n(hit_.begin() + static_cast<std::ptrdiff_t>(r * spec_.columns), columns, 0.0F);
    dirty_[static_cast<std::size_t>(r)] = 0;
  }
  for (const Footprint& f : footprints_) {
    const Eigen::Vector3f up = f.to_local.col(2);  // the world's z axis seen from the object
    for (int r = std::max(begin, f.row_begin); r < std::min(end, f.row_end); ++r) {
      const std::size_t row = static_cast<std::size_t>(r) * columns;
      const float dy = static_cast<float>(spec_.rows - 1 - r) * pitch - f.centre.y();
      dirty_[static_cast<std::size_t>(r)] = 1;
      for (int c = f.column_begin; c < f.column_end; ++c) {
        const float dx = static_cast<float>(c) * pitch - f.centre.x();
        Interval z;
        if (f.shape == scene::ShapeKind::kSphere) {
          const float square = f.extent.x() * f.extent.x() - dx * dx - dy * dy;
          if (square < 0.0F) continue;
          const float half = std::sqrt(square);
          z = {-half, half};
        } else {
          z = crossing(f.shape, f.to_local * Eigen::Vector3f(dx, dy, 0.0F), up, f.extent);
        }
        const std::size_t i = row + static_cast<std::size_t>(c);
        const float top = snapshot.height[i] - f.centre.z();
        if (z.low > z.high || z.high < top) continue;
        const float distance = std::max(0.0F, z.low - top);
        if (distance > range_) continue;
        distance_[i] = std::min(distance_[i], distance);
        hit_[i] = 1.0F;
      }
    }
  }
}

}  // namespace smartsurf::surface
