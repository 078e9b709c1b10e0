defmodule Hal.Options.ModuleLookup do
  @moduledoc """
  Finds modules of this build by names that people write: the driver in a robot file, an option of
  a command.
  """
  alias Hal.ExternalTerm

  @doc """
  The module of this name, loaded, if it is part of this build. Unknown names create no atoms.

      iex> Hal.Options.ModuleLookup.module("Hal.Pose")
      {:ok, Hal.Pose}
      iex> Hal.Options.ModuleLookup.module("Hal.NoSuchThing")
      :error
  """
  @spec module(String.t()) :: {:ok, module()} | :error
  def module(name) do
    with true <- name =~ ~r/\A[A-Z]\w*(\.[A-Z]\w*)*\z/,
         {:ok, module} <- known(name),
         true <- Code.ensure_loaded?(module),
         do: {:ok, module},
         else: (_unknown -> :error)
  end

  # A module that has not been used yet is known only by its file, which contains its name.
  defp known(name) do
    with :error <- ExternalTerm.atom("Elixir." <> name) do
      case :code.where_is_file(to_charlist("Elixir.#{name}.beam")) do
        :non_existing -> :error
        path -> Keyword.fetch(:beam_lib.info(path), :module)
      end
    end
  end
end
