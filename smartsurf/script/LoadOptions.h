// How an experiment's script is loaded and what it may use.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/process/StopSignals.h"
#include "smartsurf/scene/NamedValues.h"
#include "smartsurf/scene/SolidFactory.h"

namespace smartsurf::script {

struct LoadOptions {
  // --set name=value, in order; the last assignment to a name wins. vary.NAME=RANGE adds a nuisance or takes
  // the place of the script's, as --vary NAME=RANGE does.
  scene::Overrides overrides;
  // --seed; overrides world.seed.
  std::optional<std::uint64_t> seed;
  // --engine; overrides world.engine.
  std::optional<std::string> engine;
  // The script's text; nullopt = read the file.
  std::optional<std::string> source;
  // The folder from which the script reads files; nullopt = beside it.
  std::optional<std::filesystem::path> script_folder;
  // Builds the solids of mesh{} and hull{}; null = both are errors.
  std::shared_ptr<scene::SolidFactory> solid_factory;
  // Makes save(), restore() and restart() available.
  bool savable = false;
  // --unsafe: the full Lua standard library, including native modules.
  bool unsafe = false;
  // Loads the extension at this path for extension 'x.so'; throws scene::InputError. Null: the script may
  // only name extensions that are loaded.
  std::function<void(const std::filesystem::path&)> load_extension;
  // The folder in which the script may write files, created when it first does; empty = none.
  std::filesystem::path output_folder;
  // Receives the output of print and io.write; null = stdout.
  std::function<void(std::string_view)> print_output;
  // Receives warnings, one line each; null = stderr.
  std::function<void(std::string_view)> report_warning;

  std::uint64_t load_budget = 500'000'000;          // Lua instructions while loading
  std::uint64_t callback_budget = 50'000'000;       // Lua instructions per callback
  std::size_t memory_limit = std::size_t{1} << 30;  // bytes, of the Lua heap
  // Processor time, for what instructions do not bound: operators on long strings, collections.
  double load_time_s = 30.0, callback_time_s = 10.0;
  // Ends a running script with script::Interrupted; null = never.
  const std::atomic<bool>* stop = nullptr;
  // Ends the process, with `message` as its line or, after `stop`, none (""). Called by another thread when a
  // single operation takes longer than the processor time allowed, or goes on after `stop`: Lua cannot
  // interrupt it. Null, or `unsafe`: the operation is waited for.
  void (*end_process)(const std::string& message) = nullptr;
};

// A script was stopped by LoadOptions::stop.
using common::Interrupted;

}  // namespace smartsurf::script
