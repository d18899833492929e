#include "smartsurf/record/SizeClasses.h"

#include <algorithm>
#include <limits>
#include <map>

namespace smartsurf::record {
namespace {

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

}  // namespace smartsurf::record
