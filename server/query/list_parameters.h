// Receives the parameters of a request for points or rays. Items of a list are parsed one by one: a list is read only
// up to its first error, and is never stored as text.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "engine/core/result.h"
#include "server/query/streamed_parameters.h"

namespace terrace::server {

// The names of parameters, which outlive the sink.
struct ListNames {
  std::span<const std::string_view> lists;  // items separated by '|'; at most one of them may be sent
  std::span<const std::string_view> texts;  // besides kDrawnNames
  std::string_view json_example;            // ParameterSink::JsonExample
};

// Each parameter may occur once; `v` is ignored. Errors are kInvalidArgument. The message is for the client; it names
// the parameter and the item, and quotes no text of the client.
class ListParameters final : public ParameterSink {
 public:
  // Limit for the text of one item, and of any value that is not a list. Two numbers with all digits take 50 bytes.
  static constexpr std::size_t kMaxItemBytes = 1000;

  // Takes an item of the list `name`; the first has the number 1. Its errors end parsing.
  using AddItem = std::function<Result<void>(std::string_view name, std::size_t number, std::string_view item)>;

  ListParameters(const ListNames& names, AddItem add_item) : names_(names), add_item_(std::move(add_item)) {}

  Result<void> AddToName(std::string_view part) override;
  Result<void> EndName() override;
  Result<void> AddToValue(std::string_view part) override;
  Result<void> EndValue() override;
  std::string_view JsonExample() const override { return names_.json_example; }

  std::string_view list() const { return list_; }  // that was sent; empty: none
  const SentTexts& texts() const { return texts_; }

 private:
  bool is_in_list() const { return current_ == list_; }
  Result<void> AddToItem(std::string_view part);
  Result<void> EndItem();
  tl::unexpected<Error> Unknown() const;

  const ListNames names_;
  const AddItem add_item_;
  std::string name_;
  std::string_view current_;  // the parameter whose value is read; empty: it is ignored
  std::string_view list_;
  std::string item_;  // of the current value: an item of the list, or a whole text
  std::size_t items_ = 0;
  SentTexts texts_;
};

}  // namespace terrace::server
