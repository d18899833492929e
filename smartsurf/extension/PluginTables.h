// Reads the tables of an extension, whose structs may be of a later version of smartsurf_plugin.h, and thus
// longer. Internal to this module.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "common/state/StateArchive.h"
#include "common/text/Printable.h"
#include "smartsurf/extension/smartsurf_plugin.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/surface/Field.h"

namespace smartsurf::extension {

// A message buffer of the interface. Its text may have any bytes.
using Message = std::array<char, 256>;
inline std::string text_of(const Message& message) {
  return common::printable({message.data(), strnlen(message.data(), message.size())});
}

// Throws common::UserError with the message if create() has returned null.
void require_created(const void* instance, const std::string& type, const Message&);

// The elements of an array that steps by the size which its first element states. Throws common::UserError,
// which begins with `subject`, if a size is not one of this or a later version, or the elements differ in it.
template <class T>
std::vector<T> read_array(const T* first, std::uint32_t count, const std::string& subject) {
  std::vector<T> elements;
  if (count == 0) return elements;
  if (first == nullptr) throw common::UserError(subject + ": an array of its tables is null");
  const auto require_size = [&](std::uint32_t size) {
    if (size < sizeof(T) || size != first->size)
      throw common::UserError(subject + ": a struct of its tables has the size " + std::to_string(size) +
                              ": must be " + std::to_string(sizeof(T)) + ", sizeof the struct");
  };
  require_size(first->size);
  for (std::uint32_t i = 0; i < count; ++i) {
    std::memcpy(&elements.emplace_back(), reinterpret_cast<const char*>(first) + std::size_t{i} * first->size,
                sizeof(T));
    require_size(elements.back().size);
  }
  return elements;
}

// The values of the parameters, in their order.
std::vector<smartsurf_plugin_value> values_of(std::span<const scene::Parameter> parameters,
                                              const scene::ParameterValues& values);

// The surface as instances see it, with the arrays that it points to.
class PluginSurface {
 public:
  explicit PluginSurface(const surface::Field&);
  PluginSurface(const PluginSurface&) = delete;
  PluginSurface& operator=(const PluginSurface&) = delete;
  const smartsurf_plugin_surface* get() const { return &surface_; }

 private:
  std::vector<float> x_, y_, angle_;
  smartsurf_plugin_surface surface_;
};

// The properties of all objects as instances see them, by id.
class ObjectTable {
 public:
  // Sets catalogue_count and the arrays by id. Allocates only when objects are added.
  void describe(std::span<const scene::ObjectSpec> catalogue, smartsurf_plugin_objects&);
  // The catalogue has changed otherwise than by additions.
  void invalidate() { catalogue_ = {}; }

 private:
  std::span<const scene::ObjectSpec> catalogue_;  // which the arrays describe
  std::vector<std::uint32_t> shape_;
  std::vector<float> dimensions_, colour_, magnetism_;
  std::vector<const char*> label_;
};

// Saves or restores an instance by its callbacks. Throws common::UserError, which begins with `subject`, for
// bytes that it refuses, and for sizes that cannot be.
void archive_instance(common::StateArchive&, const std::string& subject, void* instance,
                      std::uint64_t (*save)(void*, void*, std::uint64_t),
                      int (*restore)(void*, const void*, std::uint64_t));

}  // namespace smartsurf::extension
