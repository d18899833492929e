// The compiled part of the Python package `smartsurf` (docs/python.md): environments and batches as NumPy
// arrays. Its classes are private to the package; the package's Python files wrap them.
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common/error/UserError.h"
#include "common/text/Printable.h"
#include "smartsurf/extension/Extension.h"
#include "smartsurf/python/Arrays.h"
#include "smartsurf/python/Bindings.h"
#include "smartsurf/python/Description.h"
#include "smartsurf/python/Options.h"
#include "smartsurf/simulation/EpisodeRandom.h"

namespace smartsurf::python {
namespace {

// Row i: the numbers of seed i.
Array<double> draw_uniform(const std::vector<std::uint64_t>& seeds, const std::string& purpose, int count) {
  Array<double> out({static_cast<py::ssize_t>(seeds.size()), static_cast<py::ssize_t>(count)});
  const std::span<double> numbers = writable(out);
  for (std::size_t i = 0; i < seeds.size(); ++i)
    simulation::draw_uniform(seeds[i], purpose, numbers.subspan(i * count, count));
  return out;
}

}  // namespace

PYBIND11_MODULE(_core, m) {
  m.attr("__version__") = SMARTSURF_VERSION;
  py::exception<common::UserError> type(m, "Error", PyExc_ValueError);
  type.doc() = "An error in an experiment, a value or a file, in one line without control characters.";
  static const py::handle error = type.release();
  py::register_local_exception_translator([](std::exception_ptr thrown) {
    try {
      std::rethrow_exception(std::move(thrown));
    } catch (const common::UserError& user_error) {
      PyErr_SetString(error.ptr(), common::printable(user_error.what()).c_str());
    }
  });

  m.def("load_extension", [](const std::string& path) { extension::load(path); });
  m.def("next_seed", &simulation::next_seed);
  m.def("draw_uniform", &draw_uniform);

  using scene::Overrides;
  m.def("option_values", [](std::string experiment, Overrides overrides, std::optional<std::string> source) {
    return option_values(Environment(
        make_options(std::move(experiment), "", std::move(overrides), std::nullopt, 1, std::move(source)),
        Environment::Start::kLater));
  });

  bind_simulation(m);
  bind_window(m);
  bind_batch(m);
}

}  // namespace smartsurf::python
