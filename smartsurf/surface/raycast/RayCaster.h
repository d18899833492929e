// Casts one ray per cell, the same for all cells in the cell's own frame, and finds its closest hit.
//
// Intersections are exact for every shape. Each object is projected along the rays onto the surface, and only
// the cells in its footprint are tested: the cost depends on the cells that objects cover, not on the size of
// the surface, and only cells written by the previous cast are cleared. In a rectangular layout the pins that
// a ray passes have the same offsets for all cells and are tested row by row.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/threads/ThreadPool.h"
#include "smartsurf/surface/Field.h"
#include "smartsurf/surface/raycast/CacheAlignedVector.h"
#include "smartsurf/surface/raycast/RayKernels.h"

namespace smartsurf::surface {

struct CellRay {
  Eigen::Vector3f origin{0.0F, 0.0F, 0.0F};     // relative to the centre of the cell's top, cell frame, u
  Eigen::Vector3f direction{0.0F, 0.0F, 1.0F};  // unit vector, cell frame
  float range = 8.0F;                           // u
  bool hits_pins = true;                        // whether pins block the ray
  bool from_top = true;                         // false: origin.z is relative to z = 0, not to the cell's top
};

class RayCaster {
 public:
  // Copies the cell geometry of the field.
  RayCaster(const Field&, const CellRay&);

  // Computes distance() and tag(). tags: one per body, not 0, reported by the rays that hit the body first;
  // pin_tag: the same for pins, may be 0. height: of each cell, rows × columns, row-major, row 0 north, u,
  // kNoCellHeight for a missing cell. Ties are resolved deterministically, for any number of threads. In a
  // rectangular layout only the first call allocates.
  void cast(const RayBodies& bodies, std::span<const float> tags, float pin_tag,
            std::span<const float> height, common::ThreadPool&);

  // Results of the last cast: rows × columns, row-major, row 0 north. Without a hit, the range and tag 0.
  std::span<const float> distance() const noexcept { return distance_; }  // u, in [0, range]
  std::span<const float> tag() const noexcept { return {tag_.data() + kTagPadding, distance_.size()}; }

  // Estimated single-threaded cost of a cast over this many bodies; also bounds the cost of using its
  // results.
  double cost_ns(std::size_t bodies) const noexcept;

  // Calls visit(first, last) for the spans of cells [first, last) in these rows whose results may differ
  // between the last two casts.
  template <class Use>
  void for_each_changed_span(int row_begin, int row_end, Use visit) const {
    for (int r = row_begin; r < row_end; ++r)
      for (int b = 0; b < blocks_; ++b)
        if (dirty_blocks_[r * blocks_ + b] != 0) {
          const int first = r * columns_ + b * kBlock;
          visit(first, std::min(first + kBlock, (r + 1) * columns_));
        }
  }

 private:
  // Arguments of one cast, shared by its threads.
  struct CastParams {
    RayCastJob job;
    const float* height;
    float pin_tag;
    float max_pin_height = 0.0F;
  };
  // Splits the rows into one band per thread, of about equal cost.
  void partition_rows(std::span<const RayBody> bodies, int bands);
  bool is_vertical() const noexcept;
  bool clears_own_pin() const noexcept;
  void build_pin_steps(const Field&);
  void update_row_height_bounds(const float* height, int begin, int end) noexcept;
  template <class Use>
  void for_each_dirty_block(int row, Use visit) noexcept;
  void clear_rows(int begin, int end) noexcept;
  void cast_rows_to_pins(const CastParams&, int begin, int end) noexcept;

  void build_strips(const Field&);
  void build_pin_intervals(const Field&);
  void cast_strips(CastParams&, common::ThreadPool&);
  void cast_cell_to_pins(const CastParams&, std::size_t k) noexcept;

  int rows_, columns_, blocks_;
  float pitch_;
  CellRay ray_;
  std::vector<float> x_;  // x of the ray origins, one per column
  // A row of a wide surface is about as long as a memory page, so the rows under one body map to the same L1
  // sets. The padding shifts the tags to other sets than the heights and distances.
  static constexpr std::size_t kTagPadding = 256;
  float* tag_data() noexcept { return tag_.data() + kTagPadding; }
  CacheAlignedVector<float> distance_, tag_;
  // Per block. Bit 0: written by the last cast; bit 1: by the one before.
  std::vector<std::uint8_t> dirty_blocks_;
  std::vector<PinStep> pin_steps_;                      // pins that a ray passes, ordered by t_enter
  std::vector<float> row_min_height_, row_max_height_;  // of the existing cells in each row
  std::vector<int> band_first_row_;                     // bands + 1

  // Free layouts only; all arrays are in strip order.
  struct PinInterval {
    int cell;               // index in the field
    float t_enter, t_exit;  // see PinStep
  };
  std::optional<StripLayout> strips_;
  std::vector<float> strip_height_, strip_distance_, strip_tag_;
  // cells + 1: the pins of the k-th ray are [first_pin_interval_[k], first_pin_interval_[k + 1]).
  std::vector<int> first_pin_interval_;
  std::vector<PinInterval> pin_intervals_;
};

}  // namespace smartsurf::surface
