#include "tests/server/store/fault_env.h"

#include <rocksdb/file_system.h>

#include <string>
#include <utility>

namespace terrace::server {
namespace {

using Kind = FaultPlan::Kind;
using rocksdb::FileOptions;
using rocksdb::IODebugContext;
using rocksdb::IOOptions;
using rocksdb::IOStatus;
using rocksdb::Slice;

// Errors with the text of errno: EIO for reads, a full disk for writes.
IOStatus ReadFault() { return IOStatus::IOError("made to fail: Input/output error"); }
IOStatus WriteFault() { return IOStatus::NoSpace("made to fail: No space left on device"); }

class Written : public rocksdb::FSWritableFileOwnerWrapper {
 public:
  Written(FaultPlan& plan, std::unique_ptr<rocksdb::FSWritableFile> file)
      : FSWritableFileOwnerWrapper(std::move(file)), plan_(plan) {}

  // Writes only the first half, as a torn write does.
  IOStatus Append(const Slice& data, const IOOptions& options, IODebugContext* debug) override {
    if (!plan_.Fails(Kind::kWrite)) return FSWritableFileOwnerWrapper::Append(data, options, debug);
    static_cast<void>(FSWritableFileOwnerWrapper::Append(Slice(data.data(), data.size() / 2), options, debug));
    return WriteFault();
  }
  IOStatus Append(const Slice& data, const IOOptions& options, const rocksdb::DataVerificationInfo&,
                  IODebugContext* debug) override {
    return Append(data, options, debug);
  }
  IOStatus Flush(const IOOptions& options, IODebugContext* debug) override {
    return plan_.Fails(Kind::kWrite) ? WriteFault() : FSWritableFileOwnerWrapper::Flush(options, debug);
  }
  IOStatus Sync(const IOOptions& options, IODebugContext* debug) override {
    return plan_.Fails(Kind::kWrite) ? WriteFault() : FSWritableFileOwnerWrapper::Sync(options, debug);
  }

 private:
  FaultPlan& plan_;
};

class RandomlyRead : public rocksdb::FSRandomAccessFileOwnerWrapper {
 public:
  RandomlyRead(FaultPlan& plan, std::unique_ptr<rocksdb::FSRandomAccessFile> file)
      : FSRandomAccessFileOwnerWrapper(std::move(file)), plan_(plan) {}
  IOStatus Read(std::uint64_t offset, std::size_t count, const IOOptions& options, Slice* result, char* scratch,
                IODebugContext* debug) const override {
    if (plan_.Fails(Kind::kRead)) return ReadFault();
    return FSRandomAccessFileOwnerWrapper::Read(offset, count, options, result, scratch, debug);
  }

 private:
  FaultPlan& plan_;
};

class ReadInOrder : public rocksdb::FSSequentialFileOwnerWrapper {
 public:
  ReadInOrder(FaultPlan& plan, std::unique_ptr<rocksdb::FSSequentialFile> file)
      : FSSequentialFileOwnerWrapper(std::move(file)), plan_(plan) {}
  IOStatus Read(std::size_t count, const IOOptions& options, Slice* result, char* scratch,
                IODebugContext* debug) override {
    if (plan_.Fails(Kind::kRead)) return ReadFault();
    return FSSequentialFileOwnerWrapper::Read(count, options, result, scratch, debug);
  }

 private:
  FaultPlan& plan_;
};

class FaultFileSystem : public rocksdb::FileSystemWrapper {
 public:
  explicit FaultFileSystem(FaultPlan& plan) : FileSystemWrapper(rocksdb::FileSystem::Default()), plan_(plan) {}
  const char* Name() const override { return "FaultFileSystem"; }

  IOStatus NewSequentialFile(const std::string& name, const FileOptions& options,
                             std::unique_ptr<rocksdb::FSSequentialFile>* file, IODebugContext* debug) override {
    if (plan_.Fails(Kind::kRead)) return ReadFault();
    const IOStatus status = FileSystemWrapper::NewSequentialFile(name, options, file, debug);
    if (status.ok()) *file = std::make_unique<ReadInOrder>(plan_, std::move(*file));
    return status;
  }
  IOStatus NewRandomAccessFile(const std::string& name, const FileOptions& options,
                               std::unique_ptr<rocksdb::FSRandomAccessFile>* file, IODebugContext* debug) override {
    if (plan_.Fails(Kind::kRead)) return ReadFault();
    const IOStatus status = FileSystemWrapper::NewRandomAccessFile(name, options, file, debug);
    if (status.ok()) *file = std::make_unique<RandomlyRead>(plan_, std::move(*file));
    return status;
  }
  IOStatus NewWritableFile(const std::string& name, const FileOptions& options,
                           std::unique_ptr<rocksdb::FSWritableFile>* file, IODebugContext* debug) override {
    if (plan_.Fails(Kind::kWrite)) return WriteFault();
    const IOStatus status = FileSystemWrapper::NewWritableFile(name, options, file, debug);
    if (status.ok()) *file = std::make_unique<Written>(plan_, std::move(*file));
    return status;
  }
  IOStatus RenameFile(const std::string& from, const std::string& to, const IOOptions& options,
                      IODebugContext* debug) override {
    return plan_.Fails(Kind::kWrite) ? WriteFault() : FileSystemWrapper::RenameFile(from, to, options, debug);
  }
  IOStatus DeleteFile(const std::string& name, const IOOptions& options, IODebugContext* debug) override {
    return plan_.Fails(Kind::kWrite) ? WriteFault() : FileSystemWrapper::DeleteFile(name, options, debug);
  }
  IOStatus GetChildren(const std::string& name, const IOOptions& options, std::vector<std::string>* children,
                       IODebugContext* debug) override {
    return plan_.Fails(Kind::kRead) ? ReadFault() : FileSystemWrapper::GetChildren(name, options, children, debug);
  }

 private:
  FaultPlan& plan_;
};

}  // namespace

std::unique_ptr<rocksdb::Env> MakeFaultEnv(FaultPlan& plan) {
  return rocksdb::NewCompositeEnv(std::make_shared<FaultFileSystem>(plan));
}

}  // namespace terrace::server
