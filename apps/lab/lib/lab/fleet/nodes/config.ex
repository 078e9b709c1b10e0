defmodule Lab.Fleet.Nodes.Config do
  @moduledoc "Encodes the configuration of a fleet's node as one line of text, and decodes it. Pure."

  @enforce_keys [:node, :launcher, :mesh, :part]
  defstruct @enforce_keys

  @typedoc """
  `launcher` is the process that gets all reports, `mesh` are the options of `Mesh.Options`,
  `part` is a `Lab.Node` with its options.
  """
  @type t :: %__MODULE__{
          node: node(),
          launcher: pid(),
          mesh: keyword(),
          part: {module(), map()}
        }

  @doc """
  Encodes a config as one line.

      iex> config = %Lab.Fleet.Nodes.Config{node: :a@b, launcher: self(), mesh: [], part: {Some.Part, %{}}}
      iex> config |> Lab.Fleet.Nodes.Config.line() |> Lab.Fleet.Nodes.Config.read()
      {:ok, config}
      iex> Lab.Fleet.Nodes.Config.read("junk")
      {:error, "only a fleet of nodes starts this process, and it sends the configuration"}
  """
  @spec line(t()) :: String.t()
  def line(%__MODULE__{} = config),
    do: (config |> :erlang.term_to_binary([:compressed]) |> Base.encode64()) <> "\n"

  @doc "Decodes a config. The line comes from the process that started this one, and is trusted."
  @spec read(String.t() | term()) :: {:ok, t()} | {:error, line :: String.t()}
  def read(line) do
    with true <- is_binary(line),
         {:ok, bytes} <- Base.decode64(String.trim(line)),
         # Every encoded term begins with the version byte.
         <<131, _rest::binary>> <- bytes,
         %__MODULE__{} = config <- :erlang.binary_to_term(bytes) do
      {:ok, config}
    else
      _no_config ->
        {:error, "only a fleet of nodes starts this process, and it sends the configuration"}
    end
  end
end
