// The period and the decay of a value that swings, from its extremes.
#pragma once

#include <cmath>
#include <vector>

namespace physics_fixture {

class Swing {
 public:
  explicit Swing(double dt_s) : dt_s_(dt_s) {}
  // Takes the value at the end of the next step.
  void add(double value) {
    values_.push_back(value);
    const std::size_t n = values_.size();
    const double change = n < 2 ? 0.0 : value - values_[n - 2];
    if (change == 0.0) return;  // floats are equal near an extreme
    if (change * direction_ < 0.0)
      extremes_.push_back(last_ == n - 2
                              ? vertex()
                              : Extreme{0.5 * static_cast<double>(last_ + n - 2) * dt_s_, values_[n - 2]});
    direction_ = change, last_ = n - 1;
  }
  double period_s() const {
    return 2 * (extremes_.back().at_s - extremes_.front().at_s) / static_cast<double>(extremes_.size() - 1);
  }
  // Natural logarithm of the ratio of one swing to that a period later.
  double decrement() const {
    const std::size_t n = extremes_.size();
    return 2 * std::log(size(0) / size(n - 2)) / static_cast<double>(n - 2);
  }

 private:
  struct Extreme {
    double at_s, value;
  };
  // The vertex of the parabola through the last three values.
  Extreme vertex() const {
    const std::size_t n = values_.size();
    const double before = values_[n - 3], last = values_[n - 2], value = values_[n - 1];
    const double a = 0.5 * (value - 2 * last + before), b = 0.5 * (value - before);
    return {(static_cast<double>(n) - 2 - b / (2 * a)) * dt_s_, last - b * b / (4 * a)};
  }
  double size(std::size_t i) const { return std::abs(extremes_[i + 1].value - extremes_[i].value); }

  double dt_s_;
  std::vector<double> values_;
  double direction_ = 0.0;  // of the last change
  std::size_t last_ = 0;    // the first of the last values, which are equal
  std::vector<Extreme> extremes_;
};

}  // namespace physics_fixture
