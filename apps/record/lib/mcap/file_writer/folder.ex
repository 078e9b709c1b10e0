defmodule Mcap.FileWriter.Folder do
  @moduledoc false
  # Keeps the numbered files of a folder, `run-0001.mcap` and so on, which never exceed a limit together: the oldest are
  # deleted. Files of other names neither count nor are deleted. Pure but for `list/1`.

  @type file :: {number :: pos_integer(), bytes :: non_neg_integer()}

  @doc """
  The name of a file.

      iex> Mcap.FileWriter.Folder.name(7)
      "run-0007.mcap"
  """
  @spec name(pos_integer()) :: String.t()
  def name(number), do: "run-#{String.pad_leading("#{number}", 4, "0")}.mcap"

  @doc """
  The number of a file, if it is one of ours.

      iex> for name <- ["run-0007.mcap", "run-12345.mcap", "run-7.mcap", "notes"], do: Mcap.FileWriter.Folder.number(name)
      [7, 12345, nil, nil]
  """
  @spec number(String.t()) :: pos_integer() | nil
  def number(name) do
    with [_all, digits] <- Regex.run(~r/\Arun-([0-9]{4,9})\.mcap\z/, name),
         number = String.to_integer(digits),
         true <- number > 0 and name(number) == name do
      number
    else
      _no -> nil
    end
  end

  @doc "Our files in a folder, the oldest first; the folder is made if there is none, in one that there is."
  @spec list(Path.t()) :: {:ok, [file()]} | {:error, :file.posix()}
  def list(path) do
    with result when result in [:ok, {:error, :eexist}] <- File.mkdir(path),
         {:ok, names} <- File.ls(path) do
      {:ok,
       for(
         name <- names,
         number = number(name),
         {:ok, %{size: bytes}} <- [File.lstat(Path.join(path, name))],
         do: {number, bytes}
       )
       |> Enum.sort()}
    end
  end

  @doc """
  The number of the next file.

      iex> {Mcap.FileWriter.Folder.next([]), Mcap.FileWriter.Folder.next([{3, 100}, {4, 1}])}
      {1, 5}
  """
  @spec next([file()]) :: pos_integer()
  def next([]), do: 1
  def next(files), do: elem(List.last(files), 0) + 1

  @doc """
  Which files go, and which stay, so that `needed` further bytes are within the limit.

      iex> files = [{1, 40}, {2, 40}, {3, 40}]
      iex> {Mcap.FileWriter.Folder.surplus(files, 30, 150), Mcap.FileWriter.Folder.surplus(files, 31, 150)}
      {{[], [{1, 40}, {2, 40}, {3, 40}]}, {[{1, 40}], [{2, 40}, {3, 40}]}}
      iex> Mcap.FileWriter.Folder.surplus(files, 151, 150)
      :error
  """
  @spec surplus([file()], non_neg_integer(), pos_integer()) ::
          {gone :: [file()], kept :: [file()]} | :error
  def surplus(_files, needed, limit) when needed > limit, do: :error

  def surplus(files, needed, limit) do
    bytes = files |> Enum.map(&elem(&1, 1)) |> Enum.sum()
    oldest(files, bytes + needed - limit, [])
  end

  defp oldest(files, over, gone) when over <= 0, do: {Enum.reverse(gone), files}

  defp oldest([{_number, bytes} = file | files], over, gone),
    do: oldest(files, over - bytes, [file | gone])
end
