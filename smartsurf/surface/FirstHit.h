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

#include "smartsurf/surface/Field.h"
#include "smartsurf/surface/LineVector.h"
#include "smartsurf/surface/SweepKernels.h"

namespace smartsurf::surface {

class WorkerPool;

struct Segment {
  Eigen::Vector3f origin{0.0F, 0.0F, 0.0F};     // from the centre of the cell's top, u; turned with the cell
  Eigen::Vector3f direction{0.0F, 0.0F, 1.0F};  // unit; turned with the cell
  float range = 8.0F;                           // its length, u
  bool pins = true;                             // whether it meets pins as well
  bool from_top = true;                         // false: origin.z counts from z = 0, not from the cell's top
};

class FirstHit {
 public:
  // Takes the shape of the field: where its cells stand.
  FirstHit(const Field&, const Segment&);

  // height: of each cell, rows × columns, kNoCell where there is none. marks: what cells shall hold whose
  // segment meets that body first, one a body, not 0; pin_mark: that of a pin. Equally near:
  // always the same one of them. Allocates nothing in a rectangular field.
  void sweep(const SensedBodies& bodies, std::span<const float> marks, float pin_mark,
             std::span<const float> height, WorkerPool&);

  // rows × columns, row-major, row 0 north. Where nothing is within the range: the range, and 0.
  std::span<const float> distance() const noexcept { return distance_; }  // u, in [0, range]
  std::span<const float> mark() const noexcept { return {mark_.data() + kApart, distance_.size()}; }

  // About what a sweep over so many bodies takes one thread; using what it found costs no more.
  double cost_ns(std::size_t bodies) const noexcept;

  // Calls use(first, last) for the stretches of cells [first, last) of these rows that may differ from what
  // they were before the last sweep.
  template <class Use>
  void for_changed(int row_begin, int row_end, Use use) const {
    for (int r = row_begin; r < row_end; ++r)
      for (int b = 0; b < blocks_; ++b)
        if (touched_[static_cast<std::size_t>(r * blocks_ + b)] != 0) {
          const int first = r * columns_ + b * kBlock;
          use(first, std::min(first + kBlock, (r + 1) * columns_));
        }
  }

 private:
  // One sweep's arguments, for the threads that share it.
  struct Pass {
    SweepJob job;
    const float* height;
    float pin_mark;
    float highest_pin = 0.0F;
  };
  // Cuts the rows into one band a thread, of about the same work.
  void cut_bands(std::span<const SensedBody> bodies, int bands);
  bool upright() const noexcept;
  bool clears_its_own_pin() const noexcept;
  void list_pins(const Field&);
  void find_extremes(const float* height, int begin, int end) noexcept;
  template <class Use>
  void for_touched(int row, Use use) noexcept;
  void clear_rows(int begin, int end, int end_of_band) noexcept;
  void meet_pins_of_rows(const Pass&, int begin, int end) noexcept;

  void list_strips(const Field&);
  void list_pins_of_each_cell(const Field&);
  void sweep_strips(Pass&, WorkerPool&);
  void meet_pins_of_cell(const Pass&, std::size_t k) noexcept;

  int rows_, columns_, blocks_;
  float pitch_;
  Segment segment_;
  std::vector<float> x_;  // of the segments' starts, one a column
  // Rows of a wide table are a page of memory long. So that a core's first cache holds heights, distances and
  // marks of the rows under one body, the marks begin elsewhere in a page than the others.
  static constexpr std::size_t kApart = 256;
  float* first_mark() noexcept { return mark_.data() + kApart; }
  LineVector<float> distance_, mark_;
  std::vector<std::uint8_t> touched_;  // a block's bit 0: by the last sweep, bit 1: by the one before
  std::vector<PinStep> pins_;          // that a segment passes, in the order in which it does
  std::vector<float> row_lowest_, row_highest_;  // of the cells that are there
  std::vector<int> band_first_;                  // rows: of each band, and one more at the end

  // Of a free layout: everything in the order of the strips.
  struct PassedPin {
    int cell;  // in the field
    float enter, leave;
  };
  std::optional<StripLayout> strips_;
  std::vector<float> strip_height_, strip_distance_, strip_mark_;
  std::vector<int>
      first_passed_;  // cells + 1: those of the k-th are [first_passed_[k], first_passed_[k + 1])
  std::vector<PassedPin> passed_;
};

}  // namespace smartsurf::surface
