#include "smartsurf/record/Purity.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "smartsurf/record/Recording.h"
#include "smartsurf/scene/SurfaceBounds.h"

namespace smartsurf::record {
namespace {

constexpr double kNoPurity = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kBlockValues = 1u << 20;  // floats read at once

struct Mean {
  double sum = 0.0;
  int count = 0;
  double value() const { return sum / count; }
};

std::string small_label(const std::map<std::string, Mean>& labels) {
  const auto& [first, first_mean] = *labels.begin();
  const auto& [second, second_mean] = *labels.rbegin();
  return second_mean.value() < first_mean.value() ? second : first;
}

std::vector<SizeClass> classify_by_size(const std::vector<scene::ObjectSpec>& catalogue) {
  double min_size = std::numeric_limits<double>::infinity(), max_size = 0.0;
  for (const scene::ObjectSpec& object : catalogue) {
    if (object.fixed) continue;
    min_size = std::min(min_size, object_size(object));
    max_size = std::max(max_size, object_size(object));
  }
  std::vector<SizeClass> classes(catalogue.size(), SizeClass::kNone);
  if (!(max_size > min_size * (1.0 + 1e-6))) return classes;
  for (std::size_t i = 0; i < classes.size(); ++i)
    if (!catalogue[i].fixed)
      classes[i] =
          object_size(catalogue[i]) < (min_size + max_size) / 2.0 ? SizeClass::kSmall : SizeClass::kLarge;
  return classes;
}

// Computes the share of objects in their own half.
class PurityCounter {
 public:
  PurityCounter(const scene::TableFootprint& outline, double centre)
      : footprint_(outline), centre_x_(centre) {}

  void add(SizeClass size_class, double x, double y) {
    if (size_class == SizeClass::kNone || std::isnan(x)) return;
    ++total_;
    if (!footprint_.contains(x, y)) return;
    if (size_class == SizeClass::kSmall ? x < centre_x_ : x > centre_x_) ++in_own_half_;
  }
  double value() const { return total_ > 0 ? static_cast<double>(in_own_half_) / total_ : kNoPurity; }

 private:
  const scene::TableFootprint& footprint_;
  double centre_x_;
  int in_own_half_ = 0, total_ = 0;
};

}  // namespace

double object_size(const scene::ObjectSpec& object) {
  if (object.shape == scene::ShapeKind::kBox) return (object.size.x() + object.size.y()) / 4.0;
  if (object.shape != scene::ShapeKind::kSolid) return object.radius;
  const Eigen::Vector3f edges = object.solid->bounds_max - object.solid->bounds_min;
  return static_cast<double>(edges.x() + edges.y()) / 4.0;
}

std::vector<SizeClass> classify_objects(const std::vector<scene::ObjectSpec>& catalogue) {
  std::map<std::string, Mean> labels;
  for (const scene::ObjectSpec& object : catalogue) {
    if (object.fixed || object.label.empty()) continue;
    Mean& mean = labels[object.label];
    mean.sum += object_size(object);
    ++mean.count;
  }
  if (labels.size() != 2) return classify_by_size(catalogue);
  const std::string small = small_label(labels);
  std::vector<SizeClass> classes(catalogue.size(), SizeClass::kNone);
  for (std::size_t i = 0; i < classes.size(); ++i)
    if (!catalogue[i].fixed && !catalogue[i].label.empty())
      classes[i] = catalogue[i].label == small ? SizeClass::kSmall : SizeClass::kLarge;
  return classes;
}

PurityMeter::PurityMeter(const scene::SurfaceSpec& surface) : footprint_(surface) {
  const scene::SurfaceBounds bounds = scene::compute_surface_bounds(surface);
  centre_x_ = (bounds.west + bounds.east) / 2.0;
}

void PurityMeter::add(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue) {
  if (catalogue.size() != classes_.size()) classes_ = classify_objects(catalogue);
  PurityCounter counter(footprint_, centre_x_);
  for (std::size_t i = 0; i < snapshot.object_count(); ++i)
    counter.add(classes_[snapshot.id[i]], snapshot.position[i][0], snapshot.position[i][1]);
  add_value(snapshot.time_s, counter.value());
}

void PurityMeter::add_value(double time_s, double value) {
  constexpr double kRounding_s = 1e-9;  // tolerance for tick times that round to just under 5 s
  value_ = value;
  if (!(value >= kSortedThreshold)) {
    above_threshold_since_.reset();
    return;
  }
  if (!above_threshold_since_) above_threshold_since_ = time_s;
  if (!sorted_at_ && time_s - *above_threshold_since_ >= kSortedHold_s - kRounding_s)
    sorted_at_ = above_threshold_since_;
}

PuritySeries compute_purity(const Recording& recording) {
  const std::vector<SizeClass> classes = classify_objects(recording.spec().objects);
  const auto has = [&](SizeClass c) { return std::find(classes.begin(), classes.end(), c) != classes.end(); };
  if (!has(SizeClass::kSmall) || !has(SizeClass::kLarge))
    throw scene::InputError(recording.path().string() +
                            ": has no purity: its objects have neither two labels nor two sizes");
  PurityMeter meter(recording.spec().surface);
  PuritySeries result;
  const std::size_t objects = classes.size();
  const std::size_t block = std::max<std::size_t>(1, kBlockValues / (3 * objects));
  for (std::size_t first = 0; first < recording.frames(); first += block) {
    const std::size_t count = std::min(block, recording.frames() - first);
    const std::vector<float> positions = recording.read_positions(first, count);
    for (std::size_t f = 0; f < count; ++f) {
      PurityCounter counter(meter.footprint_, meter.centre_x_);
      const float* p = positions.data() + 3 * objects * f;
      for (std::size_t i = 0; i < objects; ++i) counter.add(classes[i], p[3 * i], p[3 * i + 1]);
      meter.add_value(recording.times()[first + f], counter.value());
      result.times.push_back(recording.times()[first + f]);
      result.values.push_back(meter.value());
    }
  }
  result.sorted_at = meter.sorted_at();
  return result;
}

}  // namespace smartsurf::record
