#include "smartsurf/record/Purity.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "smartsurf/record/Recording.h"
#include "smartsurf/scene/Outline.h"

namespace smartsurf::record {
namespace {

constexpr double kNoValue = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kBlockNumbers = 1u << 20;  // positions read at once

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

std::vector<SizeClass> classes_by_size(const std::vector<scene::ObjectSpec>& catalogue) {
  double least = std::numeric_limits<double>::infinity(), most = 0.0;
  for (const scene::ObjectSpec& object : catalogue) {
    if (object.fixed) continue;
    least = std::min(least, size_of(object));
    most = std::max(most, size_of(object));
  }
  std::vector<SizeClass> classes(catalogue.size(), SizeClass::kNone);
  if (!(most > least * (1.0 + 1e-6))) return classes;
  for (std::size_t i = 0; i < classes.size(); ++i)
    if (!catalogue[i].fixed)
      classes[i] = size_of(catalogue[i]) < (least + most) / 2.0 ? SizeClass::kSmall : SizeClass::kLarge;
  return classes;
}

// Counts the objects that stand in their own half.
class Share {
 public:
  Share(const scene::TableOutline& outline, double centre) : outline_(outline), centre_(centre) {}

  void add(SizeClass which, double x, double y) {
    if (which == SizeClass::kNone || std::isnan(x)) return;
    ++all_;
    if (!outline_.holds(x, y)) return;
    if (which == SizeClass::kSmall ? x < centre_ : x > centre_) ++own_;
  }
  double value() const { return all_ > 0 ? static_cast<double>(own_) / all_ : kNoValue; }

 private:
  const scene::TableOutline& outline_;
  double centre_;
  int own_ = 0, all_ = 0;
};

}  // namespace

double size_of(const scene::ObjectSpec& object) {
  if (object.shape == scene::ShapeKind::kBox) return (object.size.x() + object.size.y()) / 4.0;
  if (object.shape != scene::ShapeKind::kSolid) return object.radius;
  const Eigen::Vector3f edges = object.solid->high - object.solid->low;
  return static_cast<double>(edges.x() + edges.y()) / 4.0;
}

std::vector<SizeClass> size_classes(const std::vector<scene::ObjectSpec>& catalogue) {
  std::map<std::string, Mean> labels;
  for (const scene::ObjectSpec& object : catalogue) {
    if (object.fixed || object.label.empty()) continue;
    Mean& mean = labels[object.label];
    mean.sum += size_of(object);
    ++mean.count;
  }
  if (labels.size() != 2) return classes_by_size(catalogue);
  const std::string small = small_label(labels);
  std::vector<SizeClass> classes(catalogue.size(), SizeClass::kNone);
  for (std::size_t i = 0; i < classes.size(); ++i)
    if (!catalogue[i].fixed && !catalogue[i].label.empty())
      classes[i] = catalogue[i].label == small ? SizeClass::kSmall : SizeClass::kLarge;
  return classes;
}

PurityMeter::PurityMeter(const scene::SurfaceSpec& surface) : outline_(surface) {
  const scene::Outline around = scene::outline_of(surface);
  centre_ = (around.west + around.east) / 2.0;
}

void PurityMeter::add(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue) {
  if (catalogue.size() != classes_.size()) classes_ = size_classes(catalogue);
  Share share(outline_, centre_);
  for (std::size_t i = 0; i < snapshot.objects(); ++i)
    share.add(classes_[snapshot.id[i]], snapshot.position[i][0], snapshot.position[i][1]);
  add_value(snapshot.time_s, share.value());
}

void PurityMeter::add_value(double time_s, double value) {
  constexpr double kRounding_s = 1e-9;  // 5 s of ticks may sum up to a hair less
  value_ = value;
  if (!(value >= kSortedPurity)) {
    high_since_.reset();
    return;
  }
  if (!high_since_) high_since_ = time_s;
  if (!sorted_at_ && time_s - *high_since_ >= kSortedHold_s - kRounding_s) sorted_at_ = high_since_;
}

Purity purity(const Recording& recording) {
  const std::vector<SizeClass> classes = size_classes(recording.spec().objects);
  const auto has = [&](SizeClass c) { return std::find(classes.begin(), classes.end(), c) != classes.end(); };
  if (!has(SizeClass::kSmall) || !has(SizeClass::kLarge))
    throw scene::InputError(recording.path().string() +
                            ": has no purity: its objects have neither two labels nor two sizes");
  PurityMeter meter(recording.spec().surface);
  Purity result;
  const std::size_t objects = classes.size();
  const std::size_t block = std::max<std::size_t>(1, kBlockNumbers / (3 * objects));
  for (std::size_t first = 0; first < recording.frames(); first += block) {
    const std::size_t count = std::min(block, recording.frames() - first);
    const std::vector<float> positions = recording.positions(first, count);
    for (std::size_t f = 0; f < count; ++f) {
      Share share(meter.outline_, meter.centre_);
      const float* p = positions.data() + 3 * objects * f;
      for (std::size_t i = 0; i < objects; ++i) share.add(classes[i], p[3 * i], p[3 * i + 1]);
      meter.add_value(recording.time()[first + f], share.value());
      result.time.push_back(recording.time()[first + f]);
      result.value.push_back(meter.value());
    }
  }
  result.sorted_at = meter.sorted_at();
  return result;
}

}  // namespace smartsurf::record
