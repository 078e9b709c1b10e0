defmodule Soak.Fleet.Processes do
  @moduledoc "Looks at processes of the operating system, where there is /proc; elsewhere it finds none."

  @doc "Those with this mark in their environment, as `{number, line}`: by `VM_FLEET`, the whole value or its beginning."
  @spec marked(String.t()) :: [{pid :: String.t(), line :: String.t()}]
  def marked(mark) do
    with {:ok, names} <- File.ls("/proc") do
      for name <- names,
          name =~ ~r/^\d+$/,
          {:ok, environment} <- [File.read("/proc/#{name}/environ")],
          marked?(environment, mark),
          do: {name, "#{name} #{command(name)}"}
    else
      {:error, _none} -> []
    end
  end

  @doc "Waits until there are none, at most so long; returns those that are left."
  @spec await_gone(String.t(), left_ms :: integer()) :: [{pid :: String.t(), line :: String.t()}]
  def await_gone(mark, left_ms) do
    left = marked(mark)

    if left == [] or left_ms <= 0 do
      left
    else
      receive do
      after
        100 -> await_gone(mark, left_ms - 100)
      end
    end
  end

  defp marked?(environment, mark) do
    prefix = "VM_FLEET=#{mark}"

    environment
    |> String.split(<<0>>)
    |> Enum.any?(&(&1 == prefix or String.starts_with?(&1, prefix <> ".")))
  end

  defp command(pid) do
    case File.read("/proc/#{pid}/cmdline") do
      {:ok, line} -> line |> String.replace(<<0>>, " ") |> String.slice(0, 80)
      {:error, _gone} -> "has ended"
    end
  end

  @doc "The processor time that a process and its ended children have used, in seconds; 0.0 where it is not known."
  @spec cpu_s(String.t()) :: float()
  def cpu_s(pid) do
    case File.read("/proc/#{pid}/stat") do
      {:ok, stat} ->
        fields = stat |> String.split(") ") |> List.last() |> String.split()
        # User and system time are the 14th and 15th field; here the count begins with the third.
        Enum.sum(for n <- [11, 12], do: String.to_integer(Enum.at(fields, n))) / 100

      {:error, _gone} ->
        0.0
    end
  end
end
