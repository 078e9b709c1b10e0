defmodule Vision.Photos do
  @moduledoc "Where the photographs of `bin/opencv-data` are; `CONVOY_PHOTOS` names another folder."

  @folder Path.expand("../../../../_build/opencv-doc", __DIR__)

  @spec path(String.t()) :: Path.t()
  def path(file), do: Path.join(System.get_env("CONVOY_PHOTOS", @folder), file)

  @doc "Tags that skip a test, with the reason, where it cannot run."
  @spec tags([String.t()]) :: keyword()
  def tags(files) do
    missing = Enum.reject(files, &File.exists?(path(&1)))

    cond do
      System.find_executable("ffmpeg") == nil -> [skip: "ffmpeg is missing"]
      missing != [] -> [skip: "#{Enum.join(missing, ", ")} missing: run bin/opencv-data"]
      true -> []
    end
  end
end
