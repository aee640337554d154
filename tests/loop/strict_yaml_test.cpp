#include "controller/config/strict_yaml.hpp"

#include <catch2/catch_message.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_exception.hpp>
#include <functional>
#include <string>
#include <vector>

namespace stance::config {
namespace {

using Catch::Matchers::Message;

StrictYaml yaml(const std::string& text) { return StrictYaml::parse(text, "robot.yaml"); }

void check_refused(const std::string& text, const std::function<void(StrictYaml&)>& read, const std::string& message) {
  CAPTURE(text);
  CHECK_THROWS_MATCHES(
      [&] {
        StrictYaml root = yaml(text);
        read(root);
      }(),
      ConfigError, Message("robot.yaml: " + message));
}

}  // namespace

TEST_CASE("EveryKindOfValueIsRead") {
  StrictYaml root = yaml(
      "number: -1.5e-3\nwhole: 7\nword: osqp\nlist: [1, 2.5, 3]\nnames: [a, b]\n"
      "below: {deep: {number: 4}}\nentries: [{x: 1}, {x: 2}]\nanothers: {x: 9}\n");
  CHECK(root.number("number") == -1.5e-3);
  CHECK(root.integer("whole") == 7);
  CHECK(root.text("word") == "osqp");
  CHECK(root.numbers("list", 3) == std::vector<double>{1.0, 2.5, 3.0});
  CHECK(root.numbers("list").size() == 3);
  CHECK(root.texts("names") == std::vector<std::string>{"a", "b"});
  StrictYaml deep = root.mapping("below").mapping("deep");
  CHECK(deep.number("number") == 4.0);
  deep.finish();
  std::vector<StrictYaml> entries = root.mappings("entries");
  REQUIRE(entries.size() == 2);
  CHECK(entries[1].integer("x") == 2);
  CHECK(root.mappings("none").empty());
  root.leave("anothers");
  CHECK_NOTHROW(root.finish());
}

TEST_CASE("AScalarIsANumberOrAWordThatStandsThere") {
  const StrictYaml root = yaml("number: 1\nword: none\nnothing:\nlist: [1]\nbelow: {a: 1}\n");
  CHECK(root.is_scalar("number"));
  CHECK(root.is_scalar("word"));
  for (const char* key : {"nothing", "list", "below", "missing"}) CHECK_FALSE(root.is_scalar(key));
}

TEST_CASE("AnUnknownKeyIsRefusedByItsFullPath") {
  check_refused(
      "a: 1\nb: 2\n", [](StrictYaml& y) { (void)y.number("a"), y.finish(); },
      "b is not a known key: correct its spelling or remove it");
  check_refused(
      "one: {two: {a: 1, b: 2}}",
      [](StrictYaml& y) {
        StrictYaml two = y.mapping("one").mapping("two");
        (void)two.number("a"), two.finish();
      },
      "one.two.b is not a known key: correct its spelling or remove it");
  check_refused(
      "entries: [{x: 1}, {x: 1, z: 3}]",
      [](StrictYaml& y) {
        for (StrictYaml& entry : y.mappings("entries")) (void)entry.number("x"), entry.finish();
      },
      "entries[2].z is not a known key: correct its spelling or remove it");
}

TEST_CASE("AMissingKeyIsRefusedByItsFullPath") {
  check_refused(
      "a: 1", [](StrictYaml& y) { y.number("b"); }, "b is missing");
  check_refused(
      "a:", [](StrictYaml& y) { y.number("a"); }, "a is missing");
  check_refused(
      "one: {two: {a: 1}}", [](StrictYaml& y) { y.mapping("one").mapping("two").text("b"); }, "one.two.b is missing");
  check_refused(
      "one: {a: 1}", [](StrictYaml& y) { y.mapping("one").mapping("two"); }, "one.two is missing");
}

TEST_CASE("AKeyThatStandsTwiceIsRefusedAtAnyDepth") {
  const auto nothing = [](StrictYaml&) {};
  check_refused("a: 1\nb: 2\na: 3\n", nothing, "a stands twice");
  check_refused("one:\n  a: 1\n  a: 1\n", nothing, "one.a stands twice");
  check_refused("one:\n  two:\n    a: 1\n    b: 2\n    a: 1\n", nothing, "one.two.a stands twice");
  check_refused("entries:\n  - {x: 1}\n  - {x: 1, x: 2}\n", nothing, "entries[2].x stands twice");
  CHECK_NOTHROW(yaml("one: {a: 1}\ntwo: {a: 1}\n"));
}

TEST_CASE("AValueOfAnotherTypeIsRefusedWithWhatItMustBe") {
  const auto refused = [](const std::string& value, const std::function<void(StrictYaml&)>& read,
                          const std::string& message) { check_refused("k: " + value, read, "k " + message); };
  refused(
      "abc", [](StrictYaml& y) { y.number("k"); }, "is 'abc', but must be a number");
  refused(
      "1.2.3", [](StrictYaml& y) { y.number("k"); }, "is '1.2.3', but must be a number");
  refused(
      "[1]", [](StrictYaml& y) { y.number("k"); }, "is a list or a mapping, but must be a number");
  refused(
      "1.5", [](StrictYaml& y) { y.integer("k"); }, "is '1.5', but must be a whole number");
  refused(
      "99999999999", [](StrictYaml& y) { y.integer("k"); }, "is '99999999999', but must be a whole number");
  refused(
      "{a: 1}", [](StrictYaml& y) { y.text("k"); }, "is a list or a mapping, but must be a text");
  refused(
      "1", [](StrictYaml& y) { y.numbers("k"); }, "must be a list of numbers");
  refused(
      "[1, x]", [](StrictYaml& y) { y.numbers("k"); }, "is 'x', but must be a number");
  refused(
      "word", [](StrictYaml& y) { y.texts("k"); }, "must be a list of names");
  refused(
      "[[a]]", [](StrictYaml& y) { y.texts("k"); }, "is a list or a mapping, but must be a name");
  refused(
      "1", [](StrictYaml& y) { y.mapping("k"); }, "must be a mapping of keys to values");
  refused(
      "{a: 1}", [](StrictYaml& y) { y.mappings("k"); }, "must be a list");
  refused(
      "[{a: 1}, 2]", [](StrictYaml& y) { y.mappings("k"); }, "entry 2 must be a mapping of keys to values");
}

TEST_CASE("AListOfAnotherLengthIsRefused") {
  check_refused(
      "k: [1, 2]", [](StrictYaml& y) { y.numbers("k", 3); }, "k has 2 entries, but must have 3");
  check_refused(
      "k: [1, 2, 3, 4]", [](StrictYaml& y) { y.numbers("k", 3); }, "k has 4 entries, but must have 3");
  check_refused(
      "k: []", [](StrictYaml& y) { y.numbers("k", 1); }, "k has 0 entries, but must have 1");
}

TEST_CASE("ANumberThatIsNotFiniteIsRefused") {
  for (const char* value : {".nan", ".inf", "-.inf"}) {
    check_refused(
        "k: " + std::string(value), [](StrictYaml& y) { y.number("k"); }, "k is not finite");
    check_refused(
        "k: [0, " + std::string(value) + "]", [](StrictYaml& y) { y.numbers("k", 2); }, "k is not finite");
  }
}

TEST_CASE("TextThatIsNoMappingIsRefusedByItsFile") {
  for (const char* text : {"", "word", "[1, 2]", "3"}) {
    CHECK_THROWS_MATCHES(yaml(text), ConfigError, Message("robot.yaml: must be a mapping of keys to values"));
  }
  CHECK_THROWS_AS(yaml("a: [1, 2"), ConfigError);
  CHECK_THROWS_AS(yaml("a: b: c: d"), ConfigError);
  CHECK_THROWS_MATCHES(yaml("? [a, b]\n: 1\n"), ConfigError,
                       Message("robot.yaml: a key is a list or a mapping, but must be a name"));
}

}  // namespace stance::config
