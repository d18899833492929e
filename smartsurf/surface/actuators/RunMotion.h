// Which runs of cells move, and bounds of their heights and speeds, so that runs at rest on their targets
// cost nothing.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "common/state/StateArchive.h"
#include "smartsurf/surface/Field.h"

namespace smartsurf::surface {

class RunMotion {
 public:
  // Over a run's cells, in the coming step.
  struct Bounds {
    float max_height = kNoCellHeight, max_speed = 0.0F;  // u, u/s
  };

  explicit RunMotion(std::size_t runs) : moving_(runs, 0), max_height_(runs, 0.0F), max_speed_(runs, 0.0F) {}

  bool is_moving(std::size_t run) const noexcept { return moving_[run] != 0; }
  void set_moving(std::size_t run) noexcept { moving_[run] = 1; }
  void set_at_rest(std::size_t run, float max_height) noexcept {
    max_height_[run] = max_height;
    moving_[run] = 0;
  }

  // Calls plan_run(run), which returns Bounds, for the runs that move, or for all, and raises the field's
  // bounds to those of each run.
  template <class PlanRun>
  void plan(bool all, Field& field, const PlanRun& plan_run) noexcept {
    for (std::size_t r = 0; r < moving_.size(); ++r) {
      if (all || is_moving(r)) {
        const Bounds bounds = plan_run(r);
        max_height_[r] = bounds.max_height;
        max_speed_[r] = bounds.max_speed;
        moving_[r] = static_cast<std::uint8_t>(bounds.max_speed != 0.0F);
      }
      field.max_height = std::max(field.max_height, max_height_[r]);
      field.max_speed = std::max(field.max_speed, max_speed_[r]);
    }
  }

  void archive(common::StateArchive& a) { a(moving_, max_height_, max_speed_); }

 private:
  std::vector<std::uint8_t> moving_;  // one per run
  std::vector<float> max_height_, max_speed_;
};

}  // namespace smartsurf::surface
