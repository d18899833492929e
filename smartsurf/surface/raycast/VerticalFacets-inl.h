// Intersects vertical lines with a convex hull: a line is inside between the highest plane that faces down
// and the lowest that faces up. RayKernels.cpp includes this file once per instruction set, hence no include
// guard. Uses IEEE operations without fused multiply-add only, so that results are bit-identical for any
// number of lanes.
#include <hwy/highway.h>

#include <bit>
#include <cstdint>
#include <limits>

#include "smartsurf/surface/raycast/RayBodies.h"

HWY_BEFORE_NAMESPACE();
namespace smartsurf::surface {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// The planes of one hull in world orientation, relative to the body's centre. Floors face down, roofs face
// up, walls are vertical.
class VerticalFacets {
 public:
  static constexpr int kMaxFacets = 64;
  static bool fits(const Facets& facets) {
    return static_cast<int>(facets.size()) * FacetBlock::kLanes <= kMaxFacets;
  }

  VerticalFacets(const Facets& facets, const Eigen::Matrix3f& to_local) {
    for (const FacetBlock& block : facets)
      for (int lane = 0; lane < FacetBlock::kLanes; lane += static_cast<int>(hn::Lanes(FacetTag())))
        add(block, lane, to_local);
  }

  // Selects one line per lane, at these x; computes the terms that do not depend on y.
  template <class D>
  void set_columns(hn::Vec<D> x) {
    set_columns<D>(floors_, x);
    set_columns<D>(roofs_, x);
    for (int k = 0; k < walls_; ++k) {
      const hn::Vec<D> beyond = hn::Sub(hn::Mul(hn::Set(D(), wall_x_[k]), x), hn::Set(D(), wall_offset_[k]));
      hn::Store(beyond, D(), wall_at_ + k * FacetBlock::kLanes);
    }
  }

  // Returns the z interval inside the hull at this y. Empty if low > high.
  template <class D, class V = hn::Vec<D>>
  HWY_INLINE void intersect_row(float y, V& low, V& high) const {
    const D d;
    low = hn::Set(d, -kInfinity), high = hn::Set(d, kInfinity);
    for (int k = 0; k < floors_.count; ++k) low = hn::Max(low, height<D>(floors_, k, y));
    for (int k = 0; k < roofs_.count; ++k) high = hn::Min(high, height<D>(roofs_, k, y));
    for (int k = 0; k < walls_; ++k) {
      const V beyond = hn::Add(hn::Load(d, wall_at_ + k * FacetBlock::kLanes), hn::Set(d, wall_y_[k] * y));
      low = hn::IfThenElse(hn::Gt(beyond, hn::Zero(d)), hn::Set(d, kInfinity), low);
    }
  }

 private:
  using FacetTag = hn::CappedTag<float, FacetBlock::kLanes>;
  static constexpr float kInfinity = std::numeric_limits<float>::infinity();
  // Planes with a smaller |normal.z| count as vertical.
  static constexpr float kMaxVerticalNormalZ = 1e-6F;
  // The plane k is z = intercept[k] + x[k]·px + y[k]·py.
  struct Planes {
    float x[kMaxFacets], y[kMaxFacets], intercept[kMaxFacets];
    HWY_ALIGN float at_columns[kMaxFacets * FacetBlock::kLanes];  // intercept + x·px of each line
    int count = 0;
  };

  HWY_INLINE void add(const FacetBlock& block, int lane, const Eigen::Matrix3f& to_local) {
    const FacetTag d;
    const auto x = hn::LoadU(d, block.x + lane), y = hn::LoadU(d, block.y + lane),
               z = hn::LoadU(d, block.z + lane), offset = hn::LoadU(d, block.offset + lane);
    const auto along = [&](int axis) {
      return hn::Add(
          hn::Add(hn::Mul(hn::Set(d, to_local(0, axis)), x), hn::Mul(hn::Set(d, to_local(1, axis)), y)),
          hn::Mul(hn::Set(d, to_local(2, axis)), z));
    };
    const auto nx = along(0), ny = along(1), nz = along(2);
    const auto vertical = hn::Lt(hn::Abs(nz), hn::Set(d, kMaxVerticalNormalZ));
    const auto per_z = hn::Div(hn::Set(d, 1.0F), hn::IfThenElse(vertical, hn::Set(d, 1.0F), nz));
    const auto slope_x = hn::Neg(hn::Mul(nx, per_z)), slope_y = hn::Neg(hn::Mul(ny, per_z)),
               intercept = hn::Mul(offset, per_z);
    // Not hn::Compress: Highway 1.0 copies its table to the stack in each call.
    HWY_ALIGN float of_facet[3][FacetBlock::kLanes];
    const auto keep = [&](auto u, auto v, auto w) {
      hn::Store(u, d, of_facet[0]), hn::Store(v, d, of_facet[1]), hn::Store(w, d, of_facet[2]);
    };
    const auto append = [&](hn::Mask<FacetTag> which, float* to_u, float* to_v, float* to_w, int& count) {
      std::uint8_t bits[8];  // as many as StoreMaskBits() may write
      hn::StoreMaskBits(d, which, bits);
      for (unsigned left = bits[0]; left != 0; left &= left - 1, ++count) {
        const int k = std::countr_zero(left);
        to_u[count] = of_facet[0][k], to_v[count] = of_facet[1][k], to_w[count] = of_facet[2][k];
      }
    };
    keep(slope_x, slope_y, intercept);
    for (Planes* const planes : {&roofs_, &floors_}) {
      const auto faces = planes == &roofs_ ? hn::Gt(nz, hn::Zero(d)) : hn::Lt(nz, hn::Zero(d));
      append(hn::AndNot(vertical, faces), planes->x, planes->y, planes->intercept, planes->count);
    }
    if (hn::AllFalse(d, vertical)) return;
    keep(nx, ny, offset);
    append(vertical, wall_x_, wall_y_, wall_offset_, walls_);
  }

  template <class D>
  static void set_columns(Planes& planes, hn::Vec<D> x) {
    const D d;
    for (int k = 0; k < planes.count; ++k)
      hn::Store(hn::Add(hn::Set(d, planes.intercept[k]), hn::Mul(hn::Set(d, planes.x[k]), x)), d,
                planes.at_columns + k * FacetBlock::kLanes);
  }

  template <class D>
  HWY_INLINE static hn::Vec<D> height(const Planes& planes, int k, float y) {
    return hn::Add(hn::Load(D(), planes.at_columns + k * FacetBlock::kLanes), hn::Set(D(), planes.y[k] * y));
  }

  Planes floors_, roofs_;
  int walls_ = 0;
  float wall_x_[kMaxFacets], wall_y_[kMaxFacets], wall_offset_[kMaxFacets];
  HWY_ALIGN float wall_at_[kMaxFacets * FacetBlock::kLanes];
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::surface
HWY_AFTER_NAMESPACE();
