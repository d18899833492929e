// Where upright lines cross a convex piece that planes bound: between the highest of the planes that face
// down and the lowest of those that face up. Included once an instruction set (see SweepKernels.cpp), hence
// no plain include guard. Only IEEE operations, no fused ones: the same bits for any number of lanes.
#include <hwy/highway.h>

#include <limits>

#include "smartsurf/surface/SensedBodies.h"

HWY_BEFORE_NAMESPACE();
namespace smartsurf::surface {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Of one piece, turned as the body is; all lengths from its centre.
class UprightFacets {
 public:
  static constexpr int kMost = 64;
  static bool fits(const Facets& facets) {
    return static_cast<int>(facets.size()) * FacetBlock::kLanes <= kMost;
  }

  UprightFacets(const Facets& facets, const Eigen::Matrix3f& to_local) {
    for (const FacetBlock& block : facets)
      for (int lane = 0; lane < FacetBlock::kLanes; lane += static_cast<int>(hn::Lanes(Few())))
        add(block, lane, to_local);
  }

  // For lines beside each other, at these x: what is the same for all y.
  template <class D>
  void pass(hn::Vec<D> x) {
    pass<D>(floors_, x);
    pass<D>(roofs_, x);
    for (int k = 0; k < walls_; ++k) {
      const hn::Vec<D> beyond = hn::Sub(hn::Mul(hn::Set(D(), wall_x_[k]), x), hn::Set(D(), wall_offset_[k]));
      hn::Store(beyond, D(), wall_at_ + k * FacetBlock::kLanes);
    }
  }

  // At that y: inside from `low` to `high`, where low ≤ high.
  template <class D, class V = hn::Vec<D>>
  HWY_INLINE void cross(float y, V& low, V& high) const {
    const D d;
    low = hn::Set(d, -kFar), high = hn::Set(d, kFar);
    for (int k = 0; k < floors_.count; ++k) low = hn::Max(low, height<D>(floors_, k, y));
    for (int k = 0; k < roofs_.count; ++k) high = hn::Min(high, height<D>(roofs_, k, y));
    for (int k = 0; k < walls_; ++k) {
      const V beyond = hn::Add(hn::Load(d, wall_at_ + k * FacetBlock::kLanes), hn::Set(d, wall_y_[k] * y));
      low = hn::IfThenElse(hn::Gt(beyond, hn::Zero(d)), hn::Set(d, kFar), low);
    }
  }

 private:
  using Few = hn::CappedTag<float, FacetBlock::kLanes>;
  static constexpr float kFar = std::numeric_limits<float>::infinity();
  // A plane that leans less than this is taken as upright.
  static constexpr float kUpright = 1e-6F;
  // The plane's height is lift + x·px + y·py.
  struct Planes {
    // Room for what a store of whole vectors writes too much.
    float x[kMost + FacetBlock::kLanes], y[kMost + FacetBlock::kLanes], lift[kMost + FacetBlock::kLanes];
    HWY_ALIGN float at[kMost * FacetBlock::kLanes];  // lift + x·px of each line
    int count = 0;
  };

  HWY_INLINE void add(const FacetBlock& block, int lane, const Eigen::Matrix3f& to_local) {
    const Few d;
    const auto x = hn::LoadU(d, block.x + lane), y = hn::LoadU(d, block.y + lane),
               z = hn::LoadU(d, block.z + lane), offset = hn::LoadU(d, block.offset + lane);
    const auto along = [&](int axis) {
      return hn::Add(
          hn::Add(hn::Mul(hn::Set(d, to_local(0, axis)), x), hn::Mul(hn::Set(d, to_local(1, axis)), y)),
          hn::Mul(hn::Set(d, to_local(2, axis)), z));
    };
    const auto nx = along(0), ny = along(1), nz = along(2);
    const auto upright = hn::Lt(hn::Abs(nz), hn::Set(d, kUpright));
    const auto per_z = hn::Div(hn::Set(d, 1.0F), hn::IfThenElse(upright, hn::Set(d, 1.0F), nz));
    const auto slope_x = hn::Neg(hn::Mul(nx, per_z)), slope_y = hn::Neg(hn::Mul(ny, per_z)),
               lift = hn::Mul(offset, per_z);
    // Compressed in registers: a store that does it is many times slower on some machines.
    const auto put = [&](auto values, hn::Mask<Few> which, float* to) {
      hn::StoreU(hn::Compress(values, which), d, to);
    };
    const auto put_planes = [&](Planes& planes, hn::Mask<Few> which) {
      put(slope_x, which, planes.x + planes.count);
      put(slope_y, which, planes.y + planes.count);
      put(lift, which, planes.lift + planes.count);
      planes.count += static_cast<int>(hn::CountTrue(d, which));
    };
    put_planes(roofs_, hn::AndNot(upright, hn::Gt(nz, hn::Zero(d))));
    put_planes(floors_, hn::AndNot(upright, hn::Lt(nz, hn::Zero(d))));
    if (hn::AllFalse(d, upright)) return;
    put(nx, upright, wall_x_ + walls_);
    put(ny, upright, wall_y_ + walls_);
    put(offset, upright, wall_offset_ + walls_);
    walls_ += static_cast<int>(hn::CountTrue(d, upright));
  }

  template <class D>
  static void pass(Planes& planes, hn::Vec<D> x) {
    const D d;
    for (int k = 0; k < planes.count; ++k)
      hn::Store(hn::Add(hn::Set(d, planes.lift[k]), hn::Mul(hn::Set(d, planes.x[k]), x)), d,
                planes.at + k * FacetBlock::kLanes);
  }

  template <class D>
  HWY_INLINE static hn::Vec<D> height(const Planes& planes, int k, float y) {
    return hn::Add(hn::Load(D(), planes.at + k * FacetBlock::kLanes), hn::Set(D(), planes.y[k] * y));
  }

  Planes floors_, roofs_;
  int walls_ = 0;
  float wall_x_[kMost + FacetBlock::kLanes], wall_y_[kMost + FacetBlock::kLanes],
      wall_offset_[kMost + FacetBlock::kLanes];
  HWY_ALIGN float wall_at_[kMost * FacetBlock::kLanes];
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::surface
HWY_AFTER_NAMESPACE();
