#include "shm-protocol/hardware/bridge/CellModel.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <vector>

namespace hardware {

CellMotion::CellMotion(const CellModel& model, double period_s, double u, bool upwards)
    : m_(model), period_s_(period_s), decay_(m_.lag_s > 0 ? std::exp(-period_s / m_.lag_s) : 0) {
  r_ = p_ = m_.zero + m_.slope * u + (upwards ? -0.5 : 0.5) * m_.play;
}

double CellMotion::advance(double u) {
  const double w = m_.zero + m_.slope * u;
  r_ = std::min(std::max(r_, w - 0.5 * m_.play), w + 0.5 * m_.play);
  const double way = r_ - p_, sign = way < 0 ? -1 : 1, speed = way < 0 ? m_.speed_down : m_.speed_up;
  const double at_most = speed * m_.lag_s;  // beyond it, the speed is limited
  if (!(std::abs(way) > at_most) || std::isinf(speed)) {
    p_ = r_ - way * decay_;
    return p_;
  }
  ++(way < 0 ? limited_down_ : limited_up_);
  const double limited_s = (std::abs(way) - at_most) / speed;
  if (limited_s >= period_s_)
    p_ += sign * speed * period_s_;
  else
    p_ = r_ - (m_.lag_s > 0 ? sign * at_most * std::exp(-(period_s_ - limited_s) / m_.lag_s) : 0);
  return p_;
}

namespace {

// zero (with the sensor's), slope, play, 1 / speed_up, 1 / speed_down, lag. The inverse speed is 0 without a
// limit, and has no jump there.
constexpr int kFree = 6;
using Vector = Eigen::Matrix<double, kFree, 1>;
using Matrix = Eigen::Matrix<double, kFree, kFree>;

CellModel model_of(const Vector& x, int delay) {
  const auto speed = [](double inverse) {
    return inverse > 1e-9 ? 1 / inverse : std::numeric_limits<double>::infinity();
  };
  return {x[0], x[1], x[2], speed(x[3]), speed(x[4]), x[5], delay};
}

Vector bounded(Vector x) {
  for (int i = 2; i < kFree; ++i) x[i] = std::max(x[i], 0.0);
  return x;
}

struct Residuals {
  Eigen::VectorXd of;  // of the valid readings
  double sum = 0;      // of squares
  int limited_up = 0, limited_down = 0;
};

class Fitter {
 public:
  explicit Fitter(const CellRecording& recording) : c_(recording) {
    for (const std::uint8_t valid : c_.valid) count_ += valid != 0;
  }
  int count() const { return count_; }

  Residuals residuals(const Vector& x, int delay) const {
    Residuals r;
    r.of.resize(count_);
    CellMotion motion(model_of(x, delay), c_.period_s, static_cast<double>(c_.command[0]), c_.upwards);
    int next = 0;
    const std::size_t d = delay;
    for (std::size_t k = 0; k < c_.command.size(); ++k) {
      const double p = motion.advance(static_cast<double>(c_.command[k >= d ? k - d : 0]));
      if (c_.valid[k]) r.of[next++] = static_cast<double>(c_.reading[k]) - p;
    }
    r.sum = r.of.squaredNorm();
    r.limited_up = motion.limited_up();
    r.limited_down = motion.limited_down();
    return r;
  }

  // One column per parameter: forward differences, or central ones, which are twice the work.
  Eigen::Matrix<double, Eigen::Dynamic, kFree> jacobian(const Vector& x, const Vector& scale, int delay,
                                                        const Residuals* here = nullptr) const {
    Eigen::Matrix<double, Eigen::Dynamic, kFree> j(count_, kFree);
    for (int i = 0; i < kFree; ++i) {
      Vector up = x, down = x;
      up[i] += 1e-4 * scale[i];
      if (!here) down[i] -= 1e-4 * scale[i];
      down = bounded(down);
      const Residuals above = residuals(up, delay);
      j.col(i) = (above.of - (here ? here->of : residuals(down, delay).of)) / (up[i] - down[i]);
    }
    return j;
  }

  // Levenberg-Marquardt from x. Returns the sum of squares.
  double improve(Vector& x, const Vector& scale, int delay, int rounds) const {
    Residuals now = residuals(x, delay);
    double damping = 1e-3;
    for (int round = 0; round < rounds; ++round) {
      const auto j = jacobian(x, scale, delay, &now);
      const Matrix normal = j.transpose() * j;
      const Vector gradient = j.transpose() * now.of;
      bool better = false;
      double gain = 0;
      for (int attempt = 0; attempt < 8 && !better; ++attempt) {
        Matrix damped = normal;
        for (int i = 0; i < kFree; ++i)
          damped(i, i) += damping * normal(i, i) + 1e-12 / (scale[i] * scale[i]);
        const Vector next = bounded(x - damped.ldlt().solve(gradient));
        Residuals then = residuals(next, delay);
        if (then.sum < now.sum) {
          better = true;
          gain = 1 - then.sum / now.sum;
          x = next;
          now = std::move(then);
          damping = std::max(damping / 10, 1e-9);
        } else {
          damping *= 10;
        }
      }
      if (!better || gain < 1e-9) break;
    }
    return now.sum;
  }

 private:
  const CellRecording& c_;
  int count_ = 0;
};

double range_of(std::span<const float> values) {
  const auto [least, most] = std::ranges::minmax(values);
  return static_cast<double>(most) - static_cast<double>(least);
}

// The straight line of the readings over the commands: is there any answer, and where do zero and slope
// begin?
Eigen::Vector2d line_through(const CellRecording& c) {
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  for (std::size_t k = 0; k < c.command.size(); ++k) {
    if (!c.valid[k]) continue;
    const Eigen::Vector2d row(1, static_cast<double>(c.command[k]));
    normal += row * row.transpose();
    right += row * static_cast<double>(c.reading[k]);
  }
  return normal.ldlt().solve(right);
}

// The greatest mean speed over a few periods, upwards or downwards.
double fastest(const CellRecording& c, bool up) {
  constexpr std::size_t kPeriods = 5;
  double most = 1e-3 * range_of(c.command) / c.period_s;
  for (std::size_t k = kPeriods; k < c.reading.size(); ++k) {
    if (!c.valid[k] || !c.valid[k - kPeriods]) continue;
    const double way = static_cast<double>(c.reading[k]) - static_cast<double>(c.reading[k - kPeriods]);
    most = std::max(most, (up ? way : -way) / (kPeriods * c.period_s));
  }
  return most;
}

// Standard deviation of the noise, by the differences of successive readings: a cell lies still most of the
// time.
double noise_of(const CellRecording& c) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < c.reading.size(); ++k)
    if (c.valid[k] && c.valid[k - 1])
      steps.push_back(std::abs(static_cast<double>(c.reading[k]) - static_cast<double>(c.reading[k - 1])));
  if (steps.empty()) return 0;
  const auto middle = steps.begin() + steps.size() / 2;
  std::ranges::nth_element(steps, middle);
  return 1.4826 * *middle / std::sqrt(2.0);
}

// s² (JᵀJ)⁻¹, with zeros for the parameters that the readings do not depend on.
Matrix covariance_of(const Eigen::Matrix<double, Eigen::Dynamic, kFree>& jacobian, const Vector& scale,
                     double variance) {
  // In units in which the columns are alike.
  Matrix normal = scale.asDiagonal() * Matrix(jacobian.transpose() * jacobian) * scale.asDiagonal();
  Vector known = Vector::Ones();
  for (int i = 0; i < kFree; ++i) {
    if (normal(i, i) > 0) continue;
    known[i] = 0;
    normal(i, i) = 1;
  }
  const Vector units = scale.cwiseProduct(known);
  return variance *
         (units.asDiagonal() * Matrix(normal.ldlt().solve(Matrix::Identity())) * units.asDiagonal());
}

// Residuals that depend on their neighbours, as those of a law that leaves something out do, raise the
// variance of what is fitted by this factor: their integrated autocorrelation, up to the first that may be
// chance.
double dependence_of(const Eigen::VectorXd& r) {
  const double squares = r.squaredNorm(), chance = 2 / std::sqrt(static_cast<double>(r.size()));
  double sum = 1;
  for (Eigen::Index k = 1; squares > 0 && k < r.size() / 4; ++k) {
    const double correlation = r.head(r.size() - k).dot(r.tail(r.size() - k)) / squares;
    if (correlation < chance) break;
    sum += 2 * correlation;
  }
  return sum;
}

struct Optimum {
  Vector x = Vector::Zero();
  int delay = 0;
  double sum = std::numeric_limits<double>::infinity();  // of squares
};

// Fits each delay in turn, until two in a row fit worse than the best one. Starts from the straight line.
Optimum best_of_delays(const Fitter& fitter, const CellRecording& c, const Eigen::Vector2d& line,
                       const Vector& scale, int most_delay) {
  Optimum best;
  Vector last = best.x;
  int worse = 0;
  for (int delay = 0; delay <= most_delay && worse < 2; ++delay) {
    Vector found = last;
    double sum = std::numeric_limits<double>::infinity();
    const auto start = [&](Vector x) {
      const double reached = fitter.improve(x, scale, delay, 30);
      if (reached >= sum) return;
      sum = reached;
      found = x;
    };
    if (delay == 0) {
      // From the fastest that the readings show: a limit that no motion reaches would keep its derivative at
      // 0.
      for (const double lag : {1.0, 4.0})
        start({line[0], line[1], 0.01 * scale[0], 1 / fastest(c, true), 1 / fastest(c, false),
               lag * c.period_s});
    } else {
      Vector x = last;
      x[5] = std::max(x[5] - c.period_s, 0.2 * c.period_s);
      start(x);
    }
    last = found;
    worse = sum < best.sum ? 0 : worse + 1;
    if (sum < best.sum) best = {found, delay, sum};
  }
  return best;
}

// A limit may have been lost on the way to the optimum, from where there is no way back, or that way may have
// ended at a wrong delay, which leaves more than noise.
Optimum fit_limits_again(const Fitter& fitter, const CellRecording& c, const Optimum& reached,
                         const Vector& scale, int most_delay) {
  Optimum best = reached;
  const bool leaves_more = reached.sum / fitter.count() > 1.5 * std::pow(noise_of(c), 2);
  const int from = leaves_more ? std::max(reached.delay - 1, 0) : reached.delay;
  const int to = leaves_more ? std::min(reached.delay + 2, most_delay) : reached.delay;
  for (int delay = from; delay <= to; ++delay) {
    for (const double lag : {1.0, 2.0, 4.0}) {
      Vector x = best.x;
      x[3] = 1 / fastest(c, true);
      x[4] = 1 / fastest(c, false);
      x[5] = lag * c.period_s;
      const double sum = fitter.improve(x, scale, delay, 30);
      if (sum < best.sum) best = {x, delay, sum};
    }
  }
  return best;
}

// The values at the optimum and their standard errors.
void set_values(CellFit& fit, const Fitter& fitter, const CellRecording& c, Optimum best,
                const Vector& scale) {
  const Residuals at_best = fitter.residuals(best.x, best.delay);
  const int degrees_of_freedom = fitter.count() - kFree;
  const double variance = best.sum / degrees_of_freedom;
  auto j = fitter.jacobian(best.x, scale, best.delay);
  const bool up = at_best.limited_up > 0, down = at_best.limited_down > 0;
  if (!up) j.col(3).setZero();
  if (!down) j.col(4).setZero();
  const double residual_variance = variance * dependence_of(at_best.of);
  Matrix covariance = covariance_of(j, scale, residual_variance);
  if (!(std::sqrt(covariance(5, 5)) <= 10 * scale[5])) {  // so far below a period that it does not show
    best.x[5] = 0;
    j.col(5).setZero();
    covariance = covariance_of(j, scale, residual_variance);
  }
  const auto error = [&](int i) { return std::sqrt(std::max(covariance(i, i), 0.0)); };
  fit.value[CellFit::kDelay] = best.delay;
  fit.value[CellFit::kSlope] = best.x[1];
  fit.error[CellFit::kSlope] = error(1);
  fit.error[CellFit::kPlay] = error(2);
  // Play that may be none is none: to correct it would only add its error to each command.
  fit.value[CellFit::kPlay] = best.x[2] > 2 * error(2) ? best.x[2] : 0;
  const auto set_speed = [&](int parameter, int i) {  // v = 1 / x: dv = v² dx
    const double v = 1 / best.x[i], its_error = v * v * error(i);
    if (its_error > v) return;  // not known: too few readings show the limit
    fit.value[parameter] = v;
    fit.error[parameter] = its_error;
  };
  if (up) set_speed(CellFit::kSpeedUp, 3);
  if (down) set_speed(CellFit::kSpeedDown, 4);
  fit.value[CellFit::kLag] = best.x[5];
  fit.error[CellFit::kLag] = error(5);
  // What rounding adds to the variance is the resolution's, not the noise's.
  const double rounding = c.resolution * c.resolution / 12;
  const double noise = std::sqrt(std::max(variance - rounding, 0.0));
  fit.value[CellFit::kNoise] = noise;
  if (noise > 0) fit.error[CellFit::kNoise] = variance / noise / std::sqrt(2.0 * degrees_of_freedom);
  double sensor_zero = 0, its_variance = 0;
  if (!c.at_rest.empty()) {
    for (const float y : c.at_rest) sensor_zero += static_cast<double>(y);
    sensor_zero = sensor_zero / static_cast<double>(c.at_rest.size()) - c.rest;
    its_variance = variance / static_cast<double>(c.at_rest.size());
  }
  fit.value[CellFit::kSensorZero] = sensor_zero;
  fit.error[CellFit::kSensorZero] = std::sqrt(its_variance);
  fit.value[CellFit::kZero] = best.x[0] - sensor_zero;
  fit.error[CellFit::kZero] = std::hypot(error(0), std::sqrt(its_variance));
}

}  // namespace

CellFit fit_cell(const CellRecording& recording, int most_delay) {
  CellRecording c = recording;
  // A reading that is NaN is unknown.
  const auto is_number = [](float y) { return std::isfinite(y); };
  std::vector<std::uint8_t> valid(c.valid.begin(), c.valid.end());
  for (std::size_t k = 0; k < valid.size(); ++k) valid[k] = valid[k] && is_number(c.reading[k]);
  c.valid = valid;
  std::vector<float> at_rest;
  std::ranges::copy_if(c.at_rest, std::back_inserter(at_rest), is_number);
  c.at_rest = at_rest;
  CellFit fit;
  fit.state = CellState::kDead;
  const Fitter fitter(c);
  if (fitter.count() < 10 * kFree) return fit;
  std::vector<float> known;
  for (std::size_t k = 0; k < c.reading.size(); ++k)
    if (c.valid[k]) known.push_back(c.reading[k]);
  if (range_of(known) == 0) return fit;
  const Eigen::Vector2d line = line_through(c);
  if (std::abs(line[1]) < 0.1) {
    fit.state = CellState::kStuck;
    return fit;
  }
  fit.state = CellState::kGood;
  const double stroke = range_of(c.command);
  Vector scale;
  scale << stroke, 1, 0.1 * stroke, c.period_s / stroke, c.period_s / stroke, 5 * c.period_s;
  const Optimum reached = best_of_delays(fitter, c, line, scale, most_delay);
  set_values(fit, fitter, c, fit_limits_again(fitter, c, reached, scale, most_delay), scale);
  return fit;
}

}  // namespace hardware
