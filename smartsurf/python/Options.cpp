#include "smartsurf/python/Options.h"

namespace smartsurf::python {

EnvironmentOptions make_options(std::string experiment, std::string engine, scene::Overrides overrides,
                                std::optional<std::uint64_t> seed, int threads,
                                std::optional<std::string> source) {
  EnvironmentOptions options;
  options.source = std::move(source);
  options.experiment = std::move(experiment);
  options.overrides = std::move(overrides);
  options.seed = seed;
  if (!engine.empty()) options.engine = std::move(engine);
  options.threads = threads;
  options.fixed_channels = true;
  return options;
}

std::shared_ptr<const common::ControllerFactory> controller_factory(const py::object& capsule) {
  if (capsule.is_none()) return nullptr;
  void* const factory = PyCapsule_GetPointer(capsule.ptr(), common::kControllerCapsule);
  if (factory == nullptr) {
    PyErr_Clear();
    throw py::type_error("the packages apron and smartsurf are of different versions: install them together");
  }
  return *static_cast<std::shared_ptr<const common::ControllerFactory>*>(factory);
}

}  // namespace smartsurf::python
