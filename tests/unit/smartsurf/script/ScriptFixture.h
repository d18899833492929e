// A fixture that loads scripts from a temporary folder per test, and a fake simulation that logs all calls.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "smartsurf/script/Experiment.h"

namespace smartsurf::script {

class FakeSimulation : public SimulationInterface {
 public:
  explicit FakeSimulation(const scene::SceneSpec& spec) {
    for (const auto& object : spec.objects) spawn(object);
    joints_ = spec.joints;
    log.clear();
  }

  scene::ObjectId spawn(const scene::ObjectSpec& object) override {
    const auto id = static_cast<scene::ObjectId>(next_id_++);
    objects_[id] = object;
    note() << "spawn " << id;
    return id;
  }
  void remove(scene::ObjectId id) override {
    objects_.erase(id);
    note() << "remove " << id;
  }
  bool is_alive(scene::ObjectId id) const override { return objects_.contains(id); }
  ObjectState state(scene::ObjectId id) const override {
    const auto& o = objects_.at(id);
    return {o.position, o.orientation, o.velocity, o.angular_velocity};
  }
  bool is_on_table(scene::ObjectId id) const override { return objects_.at(id).position.z() > 0.0; }
  std::string label(scene::ObjectId id) const override { return objects_.at(id).label; }
  std::vector<scene::ObjectId> find_objects(const std::optional<std::string>& label) const override {
    std::vector<scene::ObjectId> ids;
    for (const auto& [id, object] : objects_)
      if (!label || object.label == *label) ids.push_back(id);
    return ids;
  }
  void apply_force(scene::ObjectId id, const Eigen::Vector3d& f, const std::optional<Eigen::Vector3d>& p,
                   double s) override {
    note() << "push " << id << " " << f.transpose() << " at "
           << (p ? (std::ostringstream() << p->transpose()).str() : "centre") << " for " << s;
  }
  void set_state(scene::ObjectId id, const ObjectStateUpdate& p) override {
    auto& o = objects_.at(id);
    if (p.position) o.position = *p.position;
    if (p.orientation) o.orientation = *p.orientation;
    if (p.velocity) o.velocity = *p.velocity;
    if (p.angular_velocity) o.angular_velocity = *p.angular_velocity;
    note() << "place " << id;
  }
  bool is_fixed(scene::ObjectId id) const override { return objects_.at(id).fixed; }
  scene::JointId add_joint(const scene::JointSpec& spec) override {
    joints_.push_back(spec);
    note() << "joint " << spec.a << " " << (spec.b ? std::to_string(*spec.b) : "table");
    return static_cast<scene::JointId>(joints_.size() - 1);
  }
  bool has_joint(scene::JointId id) const override { return id < joints_.size(); }
  scene::JointKind joint_kind(scene::JointId id) const override { return joints_[id].kind; }
  void remove_joint(scene::JointId id) override { note() << "remove joint " << id; }
  void set_motor(scene::JointId id, const scene::JointMotor& m) override {
    note() << "motor " << id << " " << m.speed << " " << m.max_effort;
  }
  void set_spring(scene::JointId id, const scene::JointSpring& s) override {
    note() << "spring " << id << " " << s.stiffness << " " << s.damping << " " << s.rest;
  }
  scene::JointState joint_state(scene::JointId) const override {
    return {.coordinate = 1.5, .speed = 2.5, .effort = 3.5, .force = {4, 5, 6}};
  }
  void set_target(const std::string& channel, int row, int column, float value) override {
    if (controller_attached)
      throw scene::InputError("cells:target: a controller is attached and sets the targets");
    note() << "target " << channel << " " << row << " " << column << " " << value;
  }
  void set_targets(const std::string& channel, std::span<const float> values) override {
    last_targets.assign(values.begin(), values.end());
    note() << "targets " << channel << " " << values.size();
  }
  float sense(const std::string& channel, int row, int column, int component) const override {
    return static_cast<float>(channel.size() * 10000) + static_cast<float>(row * 100 + column) +
           0.25F * static_cast<float>(component);
  }
  float read_ground_truth(const std::string& channel, int row, int column, int component) const override {
    return -sense(channel, row, column, component);
  }
  void stop(std::string message, std::optional<bool> success) override {
    note() << "stop" << (message.empty() ? "" : " ") << message
           << (success ? *success ? " success" : " failure" : "");
  }
  void quit() override { note() << "quit"; }
  void pause() override {
    if (broken) throw std::runtime_error("simulated failure");
    note() << "pause";
  }
  void set_real_time_factor(std::optional<double> factor) override {
    if (factor)
      note() << "pace " << *factor;
    else
      note() << "pace max";
  }

  std::vector<std::string> log;
  std::vector<float> last_targets;
  bool controller_attached = false, broken = false;

 private:
  // Appends one entry to the log at the end of the full expression.
  struct Note : std::ostringstream {
    explicit Note(std::vector<std::string>& to) : log(to) {}
    ~Note() override { log.push_back(str()); }
    std::vector<std::string>& log;
  };
  Note note() { return Note(log); }

  std::map<scene::ObjectId, scene::ObjectSpec> objects_;
  std::vector<scene::JointSpec> joints_;
  unsigned next_id_ = 0;
};

class ScriptTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    // The process of a death test takes its parent's folder, which the parent removes.
    ::setenv("SCRIPT_TEST_PROCESS", std::to_string(getpid()).c_str(), 0);
    root_ = testing::TempDir() + "smartsurf-script-" + std::getenv("SCRIPT_TEST_PROCESS");
    folder = root_ / (std::string(info->test_suite_name()) + "." + info->name());
    std::filesystem::remove_all(folder);
    std::filesystem::create_directories(folder);
    options.print_output = [this](std::string_view text) { printed += text; };
  }
  void TearDown() override { std::filesystem::remove_all(root_); }

  std::filesystem::path write(const std::string& name, const std::string& text) {
    std::ofstream(folder / name, std::ios::binary) << text;
    return folder / name;
  }
  Experiment load(const std::string& text) { return Experiment::load(write("t.lua", text), options); }
  // Declares a small surface in line 1; `text` starts in line 2.
  Experiment load_on_surface(const std::string& text) {
    return load("surface{rows = 4, columns = 6, sensors = {proximity{range = 8}}}\n" + text);
  }

  // The error message without the folder; "" if nothing is thrown.
  std::string error_of(const std::string& text) {
    return caught([&] { load(text); });
  }
  // The error of a function body that runs in the first tick. The body starts in line 2.
  std::string run_error_of(const std::string& body) {
    return caught([&] {
      Experiment e = load_on_surface("at(0, function() " + body + "\nend)");
      FakeSimulation simulation(e.scene());
      e.start(simulation);
      e.tick(0.0, 0);
    });
  }
  template <typename F>
  std::string caught(F f) {
    try {
      f();
    } catch (const scene::InputError& e) {
      std::string message = e.what();
      EXPECT_EQ(message.find_first_of("\r\n"), std::string::npos) << message;
      const std::string prefix = folder.string() + "/";
      for (auto at = message.find(prefix); at != std::string::npos; at = message.find(prefix))
        message.erase(at, prefix.size());
      return message;
    }
    return "";
  }

  std::filesystem::path folder;
  LoadOptions options;
  std::string printed;

 private:
  std::filesystem::path root_;  // holds `folder`
};

// Runs ticks `first` to `last`, inclusive, with a period of 1/60 s.
inline void run_ticks(Experiment& e, std::uint64_t first, std::uint64_t last) {
  for (std::uint64_t tick = first; tick <= last; ++tick) e.tick(static_cast<double>(tick) / 60.0, tick);
}

}  // namespace smartsurf::script
