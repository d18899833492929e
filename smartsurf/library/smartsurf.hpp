// SmartSurf as a library, in C++17: smartsurf.h with RAII, and exceptions for errors. Header only, so that
// programs depend on the C functions alone, whose binary interface is stable. smartsurf.h says what threads,
// arrays and units mean.
#ifndef SMARTSURF_HPP
#define SMARTSURF_HPP

#include <smartsurf.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace smartsurf {

class Error : public std::runtime_error {
 public:
  Error(smartsurf_status status_of_call, const char* message)
      : std::runtime_error(message), status(status_of_call) {}
  smartsurf_status status;
};

namespace detail {
inline void require(smartsurf_status status) {
  if (status != SMARTSURF_OK) throw Error(status, smartsurf_error());
}
}  // namespace detail

inline void load_extension(const std::string& path) {
  detail::require(smartsurf_load_extension(path.c_str()));
}

struct Options {
  std::string file;
  std::optional<std::string> text = {};
  std::vector<std::string> set = {};  // NAME=VALUE
  std::optional<std::uint64_t> seed = {};
  std::string engine = {};  // "": the script's
  int threads = 1;
};

class Environment {
 public:
  explicit Environment(const Options& options) {
    std::vector<const char*> set;
    for (const std::string& assignment : options.set) set.push_back(assignment.c_str());
    smartsurf_options c_options{};
    c_options.size = sizeof c_options;
    c_options.file = options.file.c_str();
    c_options.text = options.text ? options.text->c_str() : nullptr;
    c_options.set = set.data();
    c_options.set_count = set.size();
    c_options.seed = options.seed ? &*options.seed : nullptr;
    c_options.engine = options.engine.empty() ? nullptr : options.engine.c_str();
    c_options.threads = options.threads;
    smartsurf_environment* made = nullptr;
    detail::require(smartsurf_create(&c_options, &made));
    environment_.reset(made);
  }

  smartsurf_result step() {
    smartsurf_result result{};
    result.size = sizeof result;
    detail::require(smartsurf_step(get(), &result));
    return result;
  }
  void reset(std::uint64_t seed) { detail::require(smartsurf_reset(get(), seed)); }

  std::string save() {
    const void* bytes = nullptr;
    std::size_t count = 0;
    detail::require(smartsurf_save(get(), &bytes, &count));
    return {static_cast<const char*>(bytes), count};
  }
  void restore(std::string_view bytes) {
    detail::require(smartsurf_restore(get(), bytes.data(), bytes.size()));
  }

  smartsurf_state state() const {
    smartsurf_state state{};
    state.size = sizeof state;
    detail::require(smartsurf_get_state(get(), &state));
    return state;
  }

  std::vector<smartsurf_channel> channels(smartsurf_direction direction) const {
    std::vector<smartsurf_channel> all(smartsurf_channel_count(get(), direction));
    for (std::size_t i = 0; i < all.size(); ++i) {
      all[i].size = sizeof all[i];
      detail::require(smartsurf_get_channel(get(), direction, i, &all[i]));
    }
    return all;
  }
  // Throws std::out_of_range if there is none of that name.
  smartsurf_channel sensor(std::string_view name) const { return find(SMARTSURF_SENSORS, name).second; }
  smartsurf_channel actuator(std::string_view name) const { return find(SMARTSURF_ACTUATORS, name).second; }
  void set_targets(std::string_view actuator, const std::vector<float>& targets) {
    detail::require(smartsurf_set_targets(get(), find(SMARTSURF_ACTUATORS, actuator).first, targets.data(),
                                          targets.size()));
  }

  smartsurf_environment* get() const { return environment_.get(); }

 private:
  struct Destroy {
    void operator()(smartsurf_environment* environment) const { smartsurf_destroy(environment); }
  };
  std::pair<std::size_t, smartsurf_channel> find(smartsurf_direction direction, std::string_view name) const {
    const std::vector<smartsurf_channel> all = channels(direction);
    for (std::size_t i = 0; i < all.size(); ++i)
      if (all[i].name == name) return {i, all[i]};
    throw std::out_of_range("no channel '" + std::string(name) + "'");
  }

  std::unique_ptr<smartsurf_environment, Destroy> environment_;
};

}  // namespace smartsurf

#endif
