// What the segments of all cells meet first: one segment a cell, the same for all in the cell's own frame.
//
// Objects are met exactly, whatever their shape. Each object is projected along the segments onto the table,
// and only the cells it may concern are tried: cost follows the cells that objects cover, not those that
// exist, and only what the sweep before had touched is cleared. In a rectangular grid the pins that a segment
// passes are the same for all cells, so they are tried row by row.
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
  Eigen::Vector3f origin{0.0F, 0.0F, 0.0F};     // from the centre of the cell's top, u; turned with the cell
  Eigen::Vector3f direction{0.0F, 0.0F, 1.0F};  // unit; turned with the cell
  float range = 8.0F;                           // its length, u
  bool hits_pins = true;                        // whether it meets pins as well
  bool from_top = true;                         // false: origin.z counts from z = 0, not from the cell's top
};

class RayCaster {
 public:
  // Takes the shape of the field: where its cells stand.
  RayCaster(const Field&, const CellRay&);

  // height: of each cell, rows × columns, kNoCell where there is none. marks: what cells shall hold whose
  // segment meets that body first, one a body, not 0; pin_mark: that of a pin. Equally near:
  // always the same one of them. Allocates nothing in a rectangular field.
  void cast(const RayBodies& bodies, std::span<const float> tags, float pin_tag,
            std::span<const float> height, common::ThreadPool&);

  // rows × columns, row-major, row 0 north. Where nothing is within the range: the range, and 0.
  std::span<const float> distance() const noexcept { return distance_; }  // u, in [0, range]
  std::span<const float> tag() const noexcept { return {tag_.data() + kTagPadding, distance_.size()}; }

  // About what a sweep over so many bodies takes one thread; using what it found costs no more.
  double cost_ns(std::size_t bodies) const noexcept;

  // Calls use(first, last) for the stretches of cells [first, last) of these rows that may differ from what
  // they were before the last sweep.
  template <class Use>
  void for_each_changed_span(int row_begin, int row_end, Use visit) const {
    for (int r = row_begin; r < row_end; ++r)
      for (int b = 0; b < blocks_; ++b)
        if (dirty_blocks_[static_cast<std::size_t>(r * blocks_ + b)] != 0) {
          const int first = r * columns_ + b * kBlock;
          visit(first, std::min(first + kBlock, (r + 1) * columns_));
        }
  }

 private:
  // One sweep's arguments, for the threads that share it.
  struct CastParams {
    RayCastJob job;
    const float* height;
    float pin_tag;
    float max_pin_height = 0.0F;
  };
  // Cuts the rows into one band a thread, of about the same work.
  void partition_rows(std::span<const RayBody> bodies, int bands);
  bool is_vertical() const noexcept;
  bool clears_own_pin() const noexcept;
  void build_pin_steps(const Field&);
  void update_row_height_bounds(const float* height, int begin, int end) noexcept;
  template <class Use>
  void for_each_dirty_block(int row, Use visit) noexcept;
  void clear_rows(int begin, int end, int band_end) noexcept;
  void cast_rows_to_pins(const CastParams&, int begin, int end) noexcept;

  void build_strips(const Field&);
  void build_pin_intervals(const Field&);
  void cast_strips(CastParams&, common::ThreadPool&);
  void cast_cell_to_pins(const CastParams&, std::size_t k) noexcept;

  int rows_, columns_, blocks_;
  float pitch_;
  CellRay ray_;
  std::vector<float> x_;  // of the segments' starts, one a column
  // Rows of a wide table are a page of memory long. So that a core's first cache holds heights, distances and
  // marks of the rows under one body, the marks begin elsewhere in a page than the others.
  static constexpr std::size_t kTagPadding = 256;
  float* tag_data() noexcept { return tag_.data() + kTagPadding; }
  CacheAlignedVector<float> distance_, tag_;
  std::vector<std::uint8_t> dirty_blocks_;  // a block's bit 0: by the last sweep, bit 1: by the one before
  std::vector<PinStep> pin_steps_;          // that a segment passes, in the order in which it does
  std::vector<float> row_min_height_, row_max_height_;  // of the cells that are there
  std::vector<int> band_first_row_;                     // rows: of each band, and one more at the end

  // Of a free layout: everything in the order of the strips.
  struct PinInterval {
    int cell;  // in the field
    float t_enter, t_exit;
  };
  std::optional<StripLayout> strips_;
  std::vector<float> strip_height_, strip_distance_, strip_tag_;
  std::vector<int>
      first_pin_interval_;  // cells + 1: those of the k-th are [first_passed_[k], first_passed_[k + 1])
  std::vector<PinInterval> pin_intervals_;
};

}  // namespace smartsurf::surface
