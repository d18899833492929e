#include "smartsurf/python/Simulation.h"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "smartsurf/python/Bindings.h"
#include "smartsurf/python/Description.h"
#include "smartsurf/python/Options.h"

namespace smartsurf::python {

void bind_simulation(py::module_& m) {
  using scene::Overrides;
  py::class_<Simulation>(m, "Simulation")
      .def(py::init([](std::string experiment, std::string engine, Overrides overrides,
                       std::optional<std::uint64_t> seed, int threads, std::optional<std::string> source) {
        return std::make_unique<Simulation>(make_options(std::move(experiment), std::move(engine),
                                                         std::move(overrides), seed, threads,
                                                         std::move(source)));
      }))
      .def("describe", [](const Simulation& s) { return describe(s.environment()); })
      .def_property_readonly("observation", &Simulation::observation)
      .def_property_readonly("objects", &Simulation::objects)
      .def_property_readonly("targets", &Simulation::targets)
      .def_property_readonly("metrics",
                             [](const Simulation& s) {
                               return s.read([](const Environment& e) { return to_dict(e.metrics()); });
                             })
      .def_property_readonly(
          "tick",
          [](const Simulation& s) {
            return s.read([](const Environment& e) { return e.simulation().partial_snapshot().tick; });
          })
      .def_property_readonly(
          "time",
          [](const Simulation& s) {
            return s.read([](const Environment& e) { return e.simulation().partial_snapshot().time_s; });
          })
      .def_property_readonly(
          "state_hash",
          [](const Simulation& s) {
            return s.read([](const Environment& e) { return e.simulation().snapshot().state_hash; });
          })
      .def_property_readonly(
          "seed", [](const Simulation& s) { return s.read([](const Environment& e) { return e.seed(); }); })
      .def_property_readonly(
          "success",
          [](const Simulation& s) { return s.read([](const Environment& e) { return e.has_succeeded(); }); })
      .def_property_readonly(
          "object_count",
          [](const Simulation& s) {
            return s.read([](const Environment& e) { return e.simulation().catalogue().size(); });
          })
      .def("label",
           [](const Simulation& s, std::uint32_t id) {
             return s.read([id](const Environment& e) { return e.simulation().label(id); });
           })
      .def_property_readonly("has_running_episode",
                             [](const Simulation& s) {
                               return s.read([](const Environment& e) { return e.has_running_episode(); });
                             })
      .def("step", &Simulation::step)
      .def("reset", &Simulation::reset)
      .def("fail", &Simulation::fail)
      .def("finish", &Simulation::finish)
      .def("record", &Simulation::record)
      .def("stop_recording", &Simulation::stop_recording)
      .def("save", &Simulation::save)
      .def("restore", &Simulation::restore)
      .def("info", &Simulation::info)
      .def("parameter_names",
           [](const Simulation& s) { return simulation::SceneParameter::names(s.environment().scene()); })
      .def("parameter", &Simulation::parameter)
      .def("set_parameter", &Simulation::set_parameter)
      .def("randomise", &Simulation::randomise)
      .def("parameter_settings", &Simulation::parameter_settings)
      .def("set_parameter_settings", &Simulation::set_parameter_settings)
      .def("place", &Simulation::place)
      .def("set_wrenches", &Simulation::set_wrenches)
      .def("render", &Simulation::render)
      .def("render_range", &Simulation::render_range);
}

}  // namespace smartsurf::python
